"use strict";
// The cable in motion. One function per player; all data stand in the page.
for (const root of document.querySelectorAll(".player")) {
  const data = JSON.parse(root.querySelector("script").textContent);
  const find = (selector) => root.querySelector(selector);
  const [slider, speed, scale] = [find(".time input"), find("select"), find(".scale input")];
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  const unpack = ({ low, high, data }) => {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    return Float64Array.from(new Uint16Array(bytes.buffer), (q) => low + (q / 65535) * (high - low));
  };
  const m = data.s.length;
  const cables = data.cables.map((c) => {
    const out = { ...c };
    for (const key of ["t", "s_o", "u", "v", "T", "mass_x", "mass_y", "mass_v", "behind", "ahead"]) out[key] = unpack(c[key]);
    out.told = c.told.map((x) => ({ ...x, data: unpack(x.data) }));
    return out;
  });
  const longest = cables.reduce((a, b) => (b.t[b.t.length - 1] > a.t[a.t.length - 1] ? b : a));
  const end = longest.t[longest.t.length - 1];
  const slope = data.drop / data.span;
  let now = 0, playing = false, last = null;

  // What a cable looks like at time t; null after its last frame.
  function at(c, t) {
    const n = c.t.length;
    if (t > c.t[n - 1] + 1e-9 * end) return null;
    let f = 0, g = n - 1;
    while (g - f > 1) { const h = (f + g) >> 1; if (c.t[h] <= t) f = h; else g = h; }
    const w = g > f ? Math.min(1, (t - c.t[f]) / (c.t[g] - c.t[f])) : 0;
    const mix = (array, i, j) => array[i] + w * (array[j] - array[i]);
    const one = (key) => mix(c[key], f, g);
    const s_o = one("s_o"), points = [];
    for (let i = 0; i < m; i++) {
      const a = f * m + i, b = g * m + i;
      // a station that the mass passes between two frames has the tension of its present side
      const passed = data.s[i] > c.s_o[f] && data.s[i] <= c.s_o[g];
      const T = passed ? c.T[data.s[i] < s_o ? b : a] : mix(c.T, a, b);
      points.push({ s: data.s[i], x: data.x[i] + mix(c.u, a, b), y: data.y[i] + mix(c.v, a, b), T });
    }
    const mass = { s: s_o, x: one("mass_x"), y: one("mass_y"), v: one("mass_v"), behind: one("behind"), ahead: one("ahead") };
    mass.told = c.told.map((x) => mix(x.data, f, g).toFixed(x.digits));
    const k = points.findIndex((p) => p.s > s_o);
    points.splice(k < 0 ? m : k, 0, { ...mass, T: mass.behind }, { ...mass, T: mass.ahead });
    return { points, mass };
  }

  // --- drawing ---------------------------------------------------------------------------------------------------
  const ink = "#1a1a1a", soft = "#555", line = "#d0d0d0", white = "#fff";
  function sheet(selector, height) {
    const canvas = find(selector), ratio = devicePixelRatio || 1, width = canvas.clientWidth;
    canvas.style.height = `${height}px`;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    }
    const g = canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    g.font = `13px ${getComputedStyle(root).fontFamily}`;
    g.lineJoin = g.lineCap = "round";
    return { g, width, height };
  }
  function text(g, words, x, y, align = "left", color = soft) {
    g.fillStyle = color; g.textAlign = align; g.fillText(words, x, y);
  }
  function color(T) {
    if (T <= 1e-6 * data.T[1]) return white; // slack
    const x = (T - data.T[0]) / (data.T[1] - data.T[0]), n = data.colors.length - 1;
    return data.colors[Math.round(n * Math.min(1, Math.max(0, x)))];
  }
  const kilo = (T, digits = 0) => (T / data.unit).toFixed(digits);

  const inner = () => find("canvas").clientWidth - 28;
  const room = () => Math.max(0.16 * inner(), 0.36 * inner() - Math.abs(slope) * inner());
  const most = () => Math.max(1, Math.floor((room() * data.span) / inner() / (data.below[1] - data.below[0])));
  // Highest and lowest point of any cable at any time, over the span; smaller exaggerations lie in between.
  const extent = new Map();
  function bounds(e) {
    if (!extent.has(e)) {
      let low = Math.min(0, data.drop), high = Math.max(0, data.drop);
      for (const c of cables) for (let k = 0; k < c.u.length; k++) {
        const x = data.x[k % m] + c.u[k], y = slope * x + e * (data.y[k % m] + c.v[k] - slope * x);
        if (y < low) low = y; else if (y > high) high = y;
      }
      extent.set(e, [low, high]);
    }
    return extent.get(e);
  }

  function drawCable(shown) {
    const width = inner(), unit = width / data.span, e = Number(scale.value);
    const [lowest, deepest] = bounds(most());
    const top = 54 - lowest * unit, height = top + deepest * unit + 46;
    const { g } = sheet(".cable", Math.round(height));
    const X = (p) => 14 + unit * p.x;
    const Y = (p) => top + unit * (slope * p.x + e * (p.y - slope * p.x));
    const path = (points) => { g.beginPath(); points.forEach((p, i) => (i ? g.lineTo(X(p), Y(p)) : g.moveTo(X(p), Y(p)))); };
    const rest = data.x.map((x, i) => ({ x, y: data.y[i] }));
    g.lineWidth = 1; g.strokeStyle = "#999"; path(rest); g.stroke();
    // supports
    g.fillStyle = ink;
    for (const p of [rest[0], rest[m - 1]]) {
      g.beginPath(); g.moveTo(X(p), Y(p)); g.lineTo(X(p) - 6, Y(p) + 11); g.lineTo(X(p) + 6, Y(p) + 11); g.fill();
    }
    shown.forEach((state, i) => {
      if (!state) return;
      const { points } = state;
      if (i === 0) {
        g.lineWidth = 8; g.strokeStyle = "#444"; path(points); g.stroke();
        g.lineWidth = 5;
        for (let k = 1; k < points.length; k++) {
          g.strokeStyle = color(0.5 * (points[k - 1].T + points[k].T)); path(points.slice(k - 1, k + 1)); g.stroke();
        }
      } else {
        g.lineWidth = 1.8; g.setLineDash([6, 6]); g.lineCap = "butt"; g.strokeStyle = "#000"; path(points); g.stroke();
        g.setLineDash([]); g.lineCap = "round";
      }
    });
    shown.forEach((state, i) => {
      if (!state) return;
      g.beginPath(); g.arc(X(state.mass), Y(state.mass), i ? 11 : 8, 0, 7);
      g.lineWidth = i ? 2.5 : 2; g.strokeStyle = i ? cables[i].color : white;
      if (!i) { g.fillStyle = cables[0].color; g.fill(); }
      g.stroke();
    });
    // scale of colours above, scale of lengths below
    const bar = Math.min(200, 0.4 * width), n = data.colors.length;
    data.colors.forEach((c, k) => { g.fillStyle = c; g.fillRect(14 + (bar * k) / n, 8, bar / n + 1, 10); });
    text(g, kilo(data.T[0]), 14, 33);
    text(g, `${kilo(data.T[1])} ${data.unitName}`, 14 + bar, 33, "right");
    text(g, "tension", 22 + bar, 18);
    g.strokeStyle = "#444"; g.lineWidth = 1; g.strokeRect(92 + bar, 8, 18, 10); text(g, "slack", 115 + bar, 18);
    const tens = 10 ** Math.floor(Math.log10(data.span / 3)), length = tens * [5, 2, 1].find((k) => k * tens <= data.span / 3);
    const low = height - 10;
    g.beginPath(); g.moveTo(14, low - 4); g.lineTo(14, low); g.lineTo(14 + unit * length, low); g.lineTo(14 + unit * length, low - 4);
    g.strokeStyle = soft; g.stroke();
    text(g, `${length} m across, or ${+(length / e).toPrecision(2)} m in depth`, 22 + unit * length, low);
  }

  function drawTension(shown) {
    const height = 210, { g, width } = sheet(".tension", height);
    const [left, right, top, foot] = [48, 10, 24, 36];
    const high = 1.06 * data.top, X = (s) => left + s * (width - left - right);
    const Y = (T) => height - foot - (T / high) * (height - top - foot);
    const rough = high / data.unit / 4, tens = 10 ** Math.floor(Math.log10(rough));
    const tick = data.unit * tens * [1, 2, 5, 10].find((k) => k * tens >= rough);
    g.lineWidth = 1;
    for (let T = 0; T <= high; T += tick) {
      g.strokeStyle = line; g.beginPath(); g.moveTo(left, Y(T)); g.lineTo(width - right, Y(T)); g.stroke();
      text(g, kilo(T, Math.max(0, -Math.floor(Math.log10(tick / data.unit)))), left - 6, Y(T) + 4, "right");
    }
    for (const s of [0, 0.2, 0.4, 0.6, 0.8, 1]) text(g, s ? String(s) : "0", X(s), height - foot + 17, s < 1 ? "center" : "right");
    text(g, `tension [${data.unitName}]`, 4, 14);
    text(g, "place along the cable s/l [–]", X(0.5), height - 4, "center");
    g.save(); g.beginPath(); g.rect(left, top - 6, width - left - right, height - top - foot + 8); g.clip();
    const curve = (points) => { g.beginPath(); points.forEach((p, i) => (i ? g.lineTo(X(p.s), Y(p.T)) : g.moveTo(X(p.s), Y(p.T)))); g.stroke(); };
    g.strokeStyle = "#999"; curve(data.s.map((s, i) => ({ s, T: data.static[i] })));
    shown.forEach((state, i) => {
      if (!state) return;
      g.strokeStyle = cables[i].color; g.lineWidth = i ? 2 : 2.5; g.setLineDash(i ? [7, 5] : []); g.lineCap = "butt";
      curve(state.points); g.setLineDash([]);
    });
    g.restore();
  }

  // --- words -----------------------------------------------------------------------------------------------------
  const legend = cables.map((c, i) =>
    `<span style="color:${c.color}">${i ? "◯" : "⬤"}</span> <b></b>: ` +
    (i ? "dashed line over it" : `thick line${cables.length > 1 ? ", coloured by its tension" : ""}`));
  find(".legend").innerHTML = [...legend, "thin grey line: cable at rest"].join("; ");
  find(".legend").querySelectorAll("b").forEach((b, i) => { b.textContent = cables[i].name; });
  const table = find(".readout");
  const row = (cells, kind) => { const tr = table.insertRow(); for (const c of cells) { const td = document.createElement(kind); td.textContent = c; tr.append(td); } return tr; };
  row(["mass", "deflection v [m]", `T behind [${data.unitName}]`, `T ahead [${data.unitName}]`, ...cables[0].told.map((x) => x.name)], "th");
  const lines = cables.map((c) => row([c.name, "", "", "", ...c.told.map(() => "")], "td"));

  function where(s_o) {
    const slack = cables.map((c) => c.slack).filter((s) => s !== null);
    if (slack.length && s_o > Math.min(...slack)) return "the cable has gone slack: no exact answer to compare with any more";
    if (data.free) return "";
    if (s_o < data.window[0] || s_o > data.window[1]) return "outside the compared range";
    return "inside the compared range";
  }

  function draw() {
    const shown = cables.map((c) => at(c, now));
    drawCable(shown); drawTension(shown);
    const s_o = (shown[cables.indexOf(longest)] || shown.find(Boolean)).mass.s;
    find(".now").textContent = `t = ${now.toFixed(2)} s, sₒ/l = ${s_o.toFixed(3)}${where(s_o) && ": "}${where(s_o)}`;
    shown.forEach((state, i) => {
      const cells = state
        ? [state.mass.v.toFixed(2), kilo(state.mass.behind, 1), kilo(state.mass.ahead, 1), ...state.mass.told]
        : [`ended at sₒ/l = ${cables[i].reached.toFixed(3)}`, "–", "–", ...cables[i].told.map(() => "–")];
      cells.forEach((c, k) => { lines[i].cells[k + 1].textContent = c; });
    });
    slider.value = Math.round((1000 * now) / end);
    slider.setAttribute("aria-valuetext", `${now.toFixed(2)} seconds, mass at ${s_o.toFixed(2)} of the length`);
  }

  // --- time ------------------------------------------------------------------------------------------------------
  function go(t) { fresh = false; now = Math.min(end, Math.max(0, t)); draw(); }
  function play(on) {
    if (on && (now >= end || fresh)) now = 0;
    playing = on; last = null; shownAt = now;
    if (on) fresh = false;
    find(".play").textContent = on ? "Pause" : "Play";
    find(".play").setAttribute("aria-pressed", on);
    if (on) requestAnimationFrame(frame);
  }
  let shownAt = 0; // what a steady clock says; `now` may lag behind it in still pictures
  let fresh = true; // nobody has chosen a time: the picture shown is only there to look at
  function frame(stamp) {
    if (!playing) return;
    if (last !== null) shownAt += ((stamp - last) / 1000) * Number(speed.value);
    last = stamp;
    if (shownAt >= end) { go(end); play(false); return; }
    // whoever asked for less motion gets twenty still pictures
    go(still.matches ? (Math.floor((20 * shownAt) / end) * end) / 20 : shownAt);
    requestAnimationFrame(frame);
  }
  for (const seconds of [40, 20, 10, 5]) speed.add(new Option(`whole travel in ${seconds} s`, end / seconds, seconds === 10, seconds === 10));
  speed.add(new Option(`real time (${end.toFixed(end < 20 ? 1 : 0)} s)`, 1));
  find(".play").addEventListener("click", () => play(!playing));
  find(".back").addEventListener("click", () => { play(false); go(now - end / 100); });
  find(".on").addEventListener("click", () => { play(false); go(now + end / 100); });
  slider.addEventListener("input", () => { play(false); go((slider.value * end) / 1000); });
  root.addEventListener("keydown", (event) => {
    const kind = event.target.tagName;
    if (event.ctrlKey || event.altKey || event.metaKey || kind === "SELECT" || kind === "SUMMARY" || event.target === scale) return;
    const step = (event.shiftKey ? 0.1 : 0.01) * end;
    const act = {
      " ": () => play(!playing), ArrowLeft: () => { play(false); go(now - step); },
      ArrowRight: () => { play(false); go(now + step); }, Home: () => { play(false); go(0); }, End: () => { play(false); go(end); },
    }[event.key];
    if (!act || (event.key === " " && kind === "BUTTON")) return;
    event.preventDefault(); act();
  });

  function rescale() {
    scale.max = most();
    find(".scale").hidden = most() < 2;
    find(".scale output").textContent = Number(scale.value) === 1 ? "drawn to scale" : `drawn ${scale.value} times too large`;
    draw();
  }
  scale.addEventListener("input", rescale);
  let width = 0;
  new ResizeObserver(() => {
    if (root.clientWidth === width) return;
    const full = width === 0 || Number(scale.value) === Number(scale.max);
    width = root.clientWidth;
    scale.max = most(); if (full) scale.value = most();
    rescale();
  }).observe(root);
  now = 0.5 * end; // something to see before it plays
  shownAt = now;
  if (!Number(scale.value) || root.clientWidth) { scale.max = most(); scale.value = most(); }
  rescale();
}
