"use strict";
// Parallel coordinates with one brush an axis, and the table of what they leave.
(() => {
  const data = JSON.parse(document.getElementById("sweep-data").textContent);
  const canvas = document.getElementById("sweep-lines"), pen = canvas.getContext("2d");
  const top = 46, bottom = 318, gap = 92, left = 50;
  const axes = data.columns;
  let chosenAxis = -1;  // by keys
  canvas.width = Math.max(640, left + gap * axes.length);
  for (const axis of axes) {
    const known = axis.values.filter(x => x !== null);
    axis.words = known.some(x => typeof x === "string") ? [...new Set(known)] : null;
    const numbers = axis.words ? axis.words.map((_, i) => i) : known;
    axis.low = Math.min(...numbers); axis.high = Math.max(...numbers);
    if (axis.low === axis.high) { axis.low -= .5; axis.high += .5; axis.log = false; }
    axis.share = x => {
      if (x === null) return null;
      const v = axis.words ? axis.words.indexOf(x) : x;
      return axis.log ? Math.log(v / axis.low) / Math.log(axis.high / axis.low) : (v - axis.low) / (axis.high - axis.low);
    };
    axis.shares = axis.values.map(axis.share);
    axis.brush = null;
  }
  const y = share => bottom - share * (bottom - top);
  const inside = i => axes.every(a => !a.brush || (a.shares[i] !== null && a.shares[i] >= a.brush[0] && a.shares[i] <= a.brush[1]));
  const short = x => typeof x === "string" ? x.slice(0, 14) : x === null ? "–" : Number(x.toPrecision(4)).toString();

  function draw() {
    pen.clearRect(0, 0, canvas.width, canvas.height);
    const chosen = data.index.map((_, i) => inside(i)), count = chosen.filter(Boolean).length;
    for (const pass of [false, true]) {
      pen.strokeStyle = pass ? `rgba(0,114,178,${Math.max(.08, Math.min(.7, 60 / count))})` : "rgba(120,120,120,.06)";
      pen.lineWidth = 1;
      chosen.forEach((good, i) => {
        if (good !== pass) return;
        pen.beginPath();
        let open = false;
        axes.forEach((a, k) => {
          if (a.shares[i] === null) { open = false; return; }
          open ? pen.lineTo(left + k * gap, y(a.shares[i])) : pen.moveTo(left + k * gap, y(a.shares[i]));
          open = true;
        });
        pen.stroke();
      });
    }
    pen.font = "11px sans-serif"; pen.textAlign = "center";
    axes.forEach((a, k) => {
      const x = left + k * gap;
      pen.strokeStyle = pen.fillStyle = "#1a1a1a"; pen.lineWidth = 1;
      pen.beginPath(); pen.moveTo(x, top); pen.lineTo(x, bottom); pen.stroke();
      pen.font = k === chosenAxis ? "bold 11px sans-serif" : "11px sans-serif";
      pen.fillText(a.name.length > 28 ? a.name.slice(0, 27) + "…" : a.name, x, k % 2 ? 12 : 26);
      pen.font = "11px sans-serif";
      pen.fillText(short(a.words ? a.words[a.high | 0] ?? "" : a.high), x, top - 6);
      pen.fillText(short(a.words ? a.words[Math.ceil(a.low)] ?? "" : a.low), x, bottom + 14);
      if (a.brush) {
        pen.fillStyle = "rgba(213,94,0,.25)"; pen.strokeStyle = "#d55e00";
        pen.fillRect(x - 8, y(a.brush[1]), 16, y(a.brush[0]) - y(a.brush[1]));
        pen.strokeRect(x - 8, y(a.brush[1]), 16, y(a.brush[0]) - y(a.brush[1]));
      }
    });
    list(chosen, count);
  }

  function cell(row, kind, text) { const c = document.createElement(kind); c.textContent = text; row.append(c); return c; }

  function list(chosen, count) {
    document.getElementById("sweep-count").textContent = `${count} of ${data.index.length} scenes; the first ${Math.min(100, count)} below. `
      + "A scene's command prints it as TOML.";
    const table = document.createElement("table"), head = table.createTHead().insertRow();
    cell(head, "th", "scene");
    axes.forEach(a => cell(head, "th", a.name)); cell(head, "th", "command");
    const body = table.createTBody();
    let shown = 0;
    for (let i = 0; i < data.index.length && shown < 100; i++) {
      if (!chosen[i]) continue;
      shown++;
      const row = body.insertRow();
      row.id = `scene-${data.index[i]}`;
      cell(row, "td", data.index[i]);
      axes.forEach(a => cell(row, "td", a.words ? a.values[i] ?? "–" : short(a.values[i])).className = a.words ? "" : "n");
      cell(row, "td", "").append(Object.assign(document.createElement("code"), {textContent: `cablefem sweep ${data.study} --scene ${data.index[i]}`}));
    }
    document.getElementById("sweep-table").replaceChildren(table);
  }

  canvas.addEventListener("keydown", event => {
    const step = {ArrowUp: .05, ArrowDown: -.05}[event.key], turn = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    if (turn) chosenAxis = Math.min(axes.length - 1, Math.max(0, chosenAxis + turn));
    const axis = axes[chosenAxis], [low, high] = axis?.brush ?? [0, 1];
    if (step && axis) axis.brush = event.shiftKey ? [low, Math.min(1, Math.max(low, high + step))] : [Math.min(high, Math.max(0, low + step)), high];
    else if (event.key === "Delete" && axis) axis.brush = null;
    else if (!turn) return;
    event.preventDefault();
    canvas.parentElement.scrollLeft = (left + gap * chosenAxis) * canvas.clientWidth / canvas.width - canvas.parentElement.clientWidth / 2;
    draw();
  });

  let drag = null;
  const at = event => {
    const box = canvas.getBoundingClientRect(), scale = canvas.width / box.width;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
  };
  const share = py => Math.min(1, Math.max(0, (bottom - py) / (bottom - top)));
  canvas.addEventListener("pointerdown", event => {
    const [px, py] = at(event), k = Math.round((px - left) / gap);
    if (axes[k] && Math.abs(px - left - k * gap) < 24) { drag = [axes[k], share(py)]; canvas.setPointerCapture(event.pointerId); }
  });
  canvas.addEventListener("pointermove", event => {
    if (!drag) return;
    const s = share(at(event)[1]);
    drag[0].brush = [Math.min(s, drag[1]), Math.max(s, drag[1])];
    draw();
  });
  canvas.addEventListener("pointerup", () => {
    if (drag && drag[0].brush && drag[0].brush[1] - drag[0].brush[0] < .005) { drag[0].brush = null; draw(); }
    drag = null;
  });
  canvas.addEventListener("dblclick", event => {
    const k = Math.round((at(event)[0] - left) / gap);
    if (axes[k]) { axes[k].brush = null; draw(); }
  });
  addEventListener("hashchange", () => {
    // a dot of a map names a scene that the table may not show: narrow to it
    const wanted = data.index.indexOf(Number(location.hash.replace("#scene-", "")));
    if (wanted >= 0 && !document.getElementById(location.hash.slice(1))) {
      axes.forEach(a => { a.brush = a.shares[wanted] === null ? null : [a.shares[wanted] - 1e-9, a.shares[wanted] + 1e-9]; });
      draw();
      document.getElementById(location.hash.slice(1))?.scrollIntoView();
    }
  });
  draw();
})();
