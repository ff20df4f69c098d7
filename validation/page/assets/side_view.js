"use strict";
// The rope in motion, of one car or of a line. One function per player; all data stand in the page.
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
  const unpacked = (object) =>
    Object.fromEntries(Object.entries(object).map(([key, x]) => [key, x && typeof x.data === "string" ? unpack(x) : x]));
  const cables = data.cables.map((c) => ({
    ...unpacked(c),
    // what touches the rope: cars, and contacts between the ends
    touching: c.touching.map((b) => ({ ...unpacked(b), readout: (b.readout || []).map(unpacked) })),
    weights: (c.weights || []).map(unpack), // rises
  }));
  const isCar = (b) => b.readout.length > 0;
  const cars = cables.flatMap((c) => c.touching.filter(isCar).map((car) => ({ cable: c, car })));
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
    const touching = c.touching.map((b) => {
      const state = { ...b, from: b.s[f], to: b.s[g] };
      for (const key of ["s", "x", "y", "behind", "ahead", "turn"]) if (b[key]) state[key] = mix(b[key], f, g);
      state.readout = b.readout.map((x) => mix(x.data, f, g).toFixed(x.digits));
      return state;
    });
    const points = [];
    for (let i = 0; i < m; i++) {
      const a = f * m + i, b = g * m + i, s = data.s[i];
      // a station that a car passes between two frames has the tension of its present side
      const by = touching.find((x) => x.from !== x.to && (s - x.from) * (s - x.to) <= 0);
      const T = by ? c.T[(s < by.s) === (by.to > by.from) ? b : a] : mix(c.T, a, b);
      points.push({ s, x: data.x[i] + mix(c.u, a, b), y: data.y[i] + mix(c.v, a, b), T });
    }
    for (const x of touching) {
      const k = points.findIndex((p) => p.s > x.s);
      points.splice(k < 0 ? points.length : k, 0, { ...x, T: x.behind }, { ...x, T: x.ahead });
    }
    const weights = c.weights.map((rise) => mix(rise, f, g));
    return { points, cars: touching.filter(isCar), weights };
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

  // --- the line that does not move ---------------------------------------------------------------------------------
  const inner = () => find("canvas").clientWidth - 28;
  const [ex, high, low] = data.envelope;
  const floor = data.ground.length ? data.ground.map((p) => p[1]) : [];
  // all depths below the chord that must be seen
  const chord = (x) => slope * x;
  const off = [
    ...ex.map((x, i) => high[i] - chord(x)), ...ex.map((x, i) => low[i] - chord(x)),
    ...data.paths.flatMap((p) => p.x.map((x, i) => p.y[i] + p.below - chord(x))), ...data.obstacles.map((o) => o.top - chord(o.x)),
    ...data.ground.map((p) => p[1] - chord(p[0])), 0,
  ];
  const [above, beneath] = [Math.min(...off), Math.max(...off)];
  const most = () => Math.max(1, Math.floor((0.4 * data.span) / (beneath - above)));

  function drawContact(g, contact, x, y, unit, isLast) {
    g.fillStyle = g.strokeStyle = ink; g.lineWidth = 1.5;
    g.beginPath();
    if (contact.kind === "counterweight") { g.arc(x, y + 6, 6, 0, 7); g.stroke(); }
    else { g.moveTo(x, y); g.lineTo(x - 6, y + 11); g.lineTo(x + 6, y + 11); g.fill(); }
    if (contact.shoe) { g.lineWidth = 4; g.beginPath(); g.moveTo(x - contact.shoe * unit, y); g.lineTo(x + contact.shoe * unit, y); g.stroke(); }
    if (contact.name) text(g, contact.name, x + (contact.x ? (isLast ? 12 : 0) : -12), y - 12, contact.x ? (isLast ? "right" : "center") : "left", ink);
  }
  // A weight hangs beside its pulley, outside the line.
  function drawWeight(g, weight, rise, X, Y, unit) {
    const x = X(weight.x) + 6 * weight.side, y = Y(weight.x, weight.y) + 6, hangs = y + 26 - rise * unit;
    g.strokeStyle = g.fillStyle = ink; g.lineWidth = 1.5;
    g.beginPath(); g.moveTo(x, y); g.lineTo(x, hangs); g.stroke();
    g.fillRect(x - 5, hangs, 10, 14);
    text(g, `${rise < 0 ? "−" : "+"}${Math.abs(rise).toFixed(2)} m`, x - 10 * weight.side, hangs + 12, weight.side > 0 ? "right" : "left");
  }
  // Cabins and wheels are drawn larger than they are, at their true angle.
  function drawCar(g, car, i, x, y, e) {
    const fill = car.color;
    const below = Math.max(car.below * e * inner() / data.span, car.body === "hangs" ? 30 : 0);
    const angle = car.body === "wheels" ? Math.atan(slope + e * (Math.tan(car.turn) - slope)) : car.turn || 0;
    const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
    g.save(); g.translate(x, y);
    g.strokeStyle = i ? fill : ink; g.lineWidth = i ? 2.5 : 2;
    if (car.body === "wheels") {
      g.transform(cos, sin, -sin, cos, 0, 0);
      g.strokeStyle = fill; g.lineWidth = 5; g.beginPath(); g.moveTo(-24, -6); g.lineTo(0, -6); g.stroke();
      g.strokeStyle = white; g.fillStyle = fill; g.lineWidth = 1.5;
      for (const wheel of [-24, 0]) { g.beginPath(); g.arc(wheel, -3, 5, 0, 7); g.fill(); g.stroke(); }
      g.restore();
      return;
    }
    if (car.body === "hangs") {
      g.transform(cos, -sin, sin, cos, 0, 0);
      g.beginPath(); g.moveTo(0, 0); g.lineTo(0, below - 14); g.stroke();
      g.fillStyle = fill; g.fillRect(-10, below - 14, 20, 16);
    } else if (!i && car.below) { g.beginPath(); g.moveTo(0, 0); g.lineTo(0, below); g.stroke(); }
    g.strokeStyle = i ? fill : white; g.fillStyle = fill;
    g.beginPath(); g.arc(0, 0, i ? 10 : car.body ? 5 : 7, 0, 7);
    if (!i) g.fill();
    g.stroke(); g.restore();
  }

  function drawCable(shown) {
    const width = inner(), unit = width / data.span, e = Number(scale.value);
    const ends = [Math.min(0, data.drop), Math.max(0, data.drop)];
    const xs = [...ex, ...ex, ...data.paths.flatMap((p) => p.x), ...data.obstacles.map((o) => o.x), ...data.ground.map((p) => p[0]), 0];
    const ys = off.map((y, i) => chord(xs[i]) + e * y); // depths below the chord, exaggerated alike
    const [lowest, deepest] = [Math.min(ends[0], ...ys), Math.max(ends[1], ...ys)];
    const top = 62 - lowest * unit;
    const hang = data.weights.map((w) => w.y * unit + 46); // below a pulley
    const height = top + Math.max(deepest * unit, ...hang) + 52;
    const { g } = sheet(".cable", Math.round(Math.max(height, 150)));
    const X = (x) => 14 + unit * x, Y = (x, y) => top + unit * (chord(x) + e * (y - chord(x)));
    const path = (x, y) => { g.beginPath(); x.forEach((a, i) => (i ? g.lineTo(X(a), Y(a, y[i])) : g.moveTo(X(a), Y(a, y[i])))); };
    const bottom = height - 30;
    if (data.ground.length) {
      path(data.ground.map((p) => p[0]), floor);
      g.lineTo(X(data.ground[data.ground.length - 1][0]), bottom + 30); g.lineTo(X(data.ground[0][0]), bottom + 30); g.closePath();
      g.fillStyle = "#e9e2d3"; g.fill(); g.lineWidth = 1.5; g.strokeStyle = "#8a7a55"; path(data.ground.map((p) => p[0]), floor); g.stroke();
    }
    for (const o of data.obstacles) {
      const x = X(o.x), y = Y(o.x, o.top);
      g.fillStyle = "#6b8e5a"; g.fillRect(x - 3, y, 6, Math.max(8, bottom - y));
      text(g, o.name, x + 8, Math.max(y + 14, bottom), "left", "#3f5c33");
    }
    // envelope, rope at rest, path of the car and of its lowest part
    path([...ex, ...ex.slice().reverse()], [...high, ...low.slice().reverse()]);
    g.closePath(); g.fillStyle = "rgba(0,0,0,.08)"; g.fill();
    g.lineWidth = 1; g.strokeStyle = "#999"; path(...data.rest); g.stroke();
    g.lineWidth = 1.2; g.strokeStyle = "#009e73"; g.setLineDash([2, 3]);
    for (const p of data.paths) {
      path(p.x, p.y); g.stroke();
      if (p.below) { path(p.x, p.y.map((y) => y + p.below)); g.stroke(); }
    }
    if (data.party) { g.lineWidth = 2.2; g.strokeStyle = "#cc79a7"; g.setLineDash([8, 3]); path(data.party.x, data.party.y); g.stroke(); }
    g.setLineDash([]);
    data.contacts.forEach((k, i) => drawContact(g, k, X(k.x), Y(k.x, k.y), unit, i === data.contacts.length - 1));
    for (const b of data.brakes) {
      const [x, y] = [X(b.x), Y(b.x, b.y)];
      g.strokeStyle = "#d55e00"; g.lineWidth = 2; g.beginPath(); g.moveTo(x, y - 16); g.lineTo(x, y + 6); g.stroke();
      text(g, "brake", x, y - 20, "center", "#a04600");
    }
    const named = data.obstacles.map((o) => [X(o.x) - 3, X(o.x) + 12 + g.measureText(o.name).width]);
    let free = -1e9; // where the next word may begin
    for (const v of data.speeds) {
      const half = g.measureText(v.text).width / 2 + 4, at = X(v.x);
      if (at - half < free || named.some(([from, to]) => at + half > from && at - half < to)) continue;
      text(g, v.text, at, Y(v.x, v.y) + 20 + data.paths[0].below * e * unit, "center", "#00654a");
      free = at + half;
    }
    // the rope now
    shown.forEach((state, i) => {
      if (!state) return;
      const [x, y] = [state.points.map((p) => p.x), state.points.map((p) => p.y)];
      if (i === 0) {
        g.lineWidth = 6; g.strokeStyle = "#444"; path(x, y); g.stroke();
        g.lineWidth = 4;
        for (let k = 1; k < x.length; k++) {
          g.strokeStyle = color(0.5 * (state.points[k - 1].T + state.points[k].T)); path(x.slice(k - 1, k + 1), y.slice(k - 1, k + 1)); g.stroke();
        }
      } else {
        g.lineWidth = 1.8; g.setLineDash([6, 6]); g.lineCap = "butt"; g.strokeStyle = "#000"; path(x, y); g.stroke();
        g.setLineDash([]); g.lineCap = "round";
      }
    });
    shown.forEach((state, i) => {
      if (!state) return;
      state.weights.forEach((rise, k) => drawWeight(g, data.weights[k], rise, X, Y, e * unit));
      for (const car of state.cars) drawCar(g, car, i, X(car.x), Y(car.x, car.y), e);
    });
    // scale of colours above, scale of lengths below
    const bar = Math.min(200, 0.4 * width), n = data.colors.length;
    data.colors.forEach((c, k) => { g.fillStyle = c; g.fillRect(14 + (bar * k) / n, 8, bar / n + 1, 10); });
    text(g, kilo(data.T[0]), 14, 33);
    text(g, `${kilo(data.T[1])} ${data.unitName}`, 14 + bar, 33, "right");
    text(g, "tension", 22 + bar, 18);
    if (cables.some((c) => typeof c.slack === "number")) {
      g.strokeStyle = "#444"; g.lineWidth = 1; g.strokeRect(92 + bar, 8, 18, 10); text(g, "slack", 115 + bar, 18);
    }
    const tens = 10 ** Math.floor(Math.log10(data.span / 3)), length = tens * [5, 2, 1].find((k) => k * tens <= data.span / 3);
    const foot = Math.round(Math.max(height, 150)) - 10;
    g.beginPath(); g.moveTo(14, foot - 4); g.lineTo(14, foot); g.lineTo(14 + unit * length, foot); g.lineTo(14 + unit * length, foot - 4);
    g.strokeStyle = soft; g.lineWidth = 1; g.stroke();
    text(g, e === 1 ? `${length} m, across and in depth` : `${length} m across, or ${+(length / e).toPrecision(2)} m in depth`, 22 + unit * length, foot);
  }

  function drawTension(shown) {
    const height = 210, { g, width } = sheet(".tension", height);
    const [left, right, top, foot] = [48, 18, 24, 36];
    const room = 0.15 * (data.T[1] - data.T[0]) || 0.1 * data.T[1];
    const least = Math.max(0, data.T[0] - room), high = data.T[1] + room, X = (s) => left + (s / data.s[m - 1]) * (width - left - right);
    const Y = (T) => height - foot - ((T - least) / (high - least)) * (height - top - foot);
    const rough = (high - least) / data.unit / 4, tens = 10 ** Math.floor(Math.log10(rough));
    const tick = data.unit * tens * [1, 2, 5, 10].find((k) => k * tens >= rough);
    g.lineWidth = 1;
    for (let T = tick * Math.ceil(least / tick); T <= high; T += tick) {
      g.strokeStyle = line; g.beginPath(); g.moveTo(left, Y(T)); g.lineTo(width - right, Y(T)); g.stroke();
      text(g, kilo(T, Math.max(0, -Math.floor(Math.log10(tick / data.unit)))), left - 6, Y(T) + 4, "right");
    }
    const whole = data.s[m - 1], about = whole / 5, ten = 10 ** Math.floor(Math.log10(about));
    const apart = ten * [1, 2, 5, 10].find((k) => k * ten >= about);
    for (let s = 0; s <= whole; s += apart) text(g, String(+s.toPrecision(4)), X(s), height - foot + 17, "center");
    text(g, `tension [${data.unitName}]`, 4, 14);
    text(g, "metres along the rope", X(0.5 * data.s[m - 1]), height - 4, "center");
    g.save(); g.beginPath(); g.rect(left, top - 6, width - left - right, height - top - foot + 8); g.clip();
    const curve = (points) => { g.beginPath(); points.forEach((p, i) => (i ? g.lineTo(X(p.s), Y(p.T)) : g.moveTo(X(p.s), Y(p.T)))); g.stroke(); };
    g.strokeStyle = "#999"; curve(data.static.map((T, i) => ({ s: data.s[i], T })));
    shown.forEach((state, i) => {
      if (!state) return;
      g.strokeStyle = data.line ? "#0072b2" : cables[i].touching[0].color; g.lineWidth = i ? 2 : 2.5; g.setLineDash(i ? [7, 5] : []); g.lineCap = "butt";
      curve(state.points); g.setLineDash([]);
    });
    g.restore();
  }

  // --- words -----------------------------------------------------------------------------------------------------
  const sign = (color, i) => `<span style="color:${color}">${i ? "◯" : "⬤"}</span> <b></b>`;
  const rope = `thick line${cables.length > 1 || data.line ? ", coloured by its tension" : ""}`;
  const legend = data.line
    ? [`${cars.map(({ car }) => sign(car.color, 0)).join(", ")}: ${cars.length > 1 ? "cars" : "car"}${data.enlarged ? ", larger than to scale" : ""}`, `${rope}: rope`]
    : cars.map(({ car }, i) => `${sign(car.color, i)}: ${i ? "dashed line over it" : rope}`);
  const lowest = data.paths.some((p) => p.below) ? " and of its lowest part" : "";
  const still_ = ["thin grey line: empty rope at rest", "grey band: where the rope was", `green dots: path of ${data.line && cars.length > 1 ? "each" : "the"} car${lowest}`];
  const theirs = data.party ? ["purple dashes: path of the car by <b></b>"] : [];
  const names = [...cars.map(({ car }) => car.name), ...(data.party ? [data.party.name] : [])];
  find(".legend").innerHTML = [...legend, ...still_, ...theirs].join("; ");
  find(".legend").querySelectorAll("b").forEach((b, i) => { b.textContent = names[i]; });
  const table = find(".readout");
  const row = (cells, kind) => { const tr = table.insertRow(); for (const c of cells) { const td = document.createElement(kind); td.textContent = c; tr.append(td); } return tr; };
  row(["at this time", ...names.slice(0, cars.length)], "th");
  const heads = [...new Set(cars.flatMap(({ car }) => car.readout.map((x) => x.name)))];
  const lines = heads.map((head) => row([head, ...cars.map(() => "")], "td"));

  function where(s_o) {
    const slack = cables.map((c) => c.slack).filter((s) => typeof s === "number");
    return slack.length && s_o > Math.min(...slack) ? ": the rope has gone slack somewhere" : "";
  }

  function draw() {
    const shown = cables.map((c) => at(c, now));
    drawCable(shown); drawTension(shown);
    const first = shown[cables.indexOf(longest)] || shown.find(Boolean), s_o = first.cars[0].s;
    const places = data.line ? first.cars.map((car) => `${car.name} at ${car.s.toFixed(1)} m`).join(", ") : `${s_o.toFixed(1)} m`;
    find(".now").textContent = `${now.toFixed(2)} s, ${places} along the rope${where(s_o)}`;
    cars.forEach(({ cable, car }, i) => {
      const state = shown[cables.indexOf(cable)];
      const present = state && state.cars.find((x) => x.name === car.name);
      heads.forEach((head, k) => {
        const j = car.readout.findIndex((x) => x.name === head);
        lines[k].cells[i + 1].textContent = present && j >= 0 ? present.readout[j] : k || present ? "–" : "ended";
      });
    });
    slider.value = Math.round((1000 * now) / end);
    slider.setAttribute("aria-valuetext", `${now.toFixed(2)} seconds, car at ${s_o.toFixed(1)} metres`);
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
    find(".scale output").textContent = Number(scale.value) === 1 ? "to scale" : `${scale.value} times too deep`;
    draw();
  }
  scale.addEventListener("input", rescale);
  let width = 0;
  new ResizeObserver(() => {
    if (root.clientWidth === width) return;
    width = root.clientWidth;
    rescale();
  }).observe(root);
  now = 0.5 * end; // something to see before it plays
  shownAt = now;
  scale.value = 1;
  rescale();
}
