/* Draws every plot of the report, the comparisons, the view and the panel.

   A plot is a description (bench/web/plot.py has its fields) and arrays. uPlot gives axes, cursor
   and selection; curves, marks and lanes are drawn here, since each series has times of its own.
   Plots of one group share zoom, cursor and the measuring cursors A and B. Colours are names of
   variables of the style sheet, so a change between light and dark redraws and nothing else. */
"use strict";
const Plots = (() => {
  const MISSING = -2147483648, LANE = 13, MOST_POINTS = 6000;
  const all = new Set();
  let inks = new Map();

  const ink = name => {
    if (!inks.has(name)) {
      const style = getComputedStyle(document.documentElement);
      inks.set(name, style.getPropertyValue("--" + name).trim() || name);
    }
    return inks.get(name);
  };

  /* ---- arrays ---- */

  async function inflated(base64) {
    const raw = Uint8Array.from(atob(base64), c => c.charCodeAt(0));
    const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  /* Columns are differences of 32-bit steps, least bytes first (bench/web/columns.py). */
  async function unpack(packed) {
    const bytes = await inflated(packed.bytes);
    let at = 0;
    return packed.columns.map(([n, step, origin]) => {
      const values = new Float64Array(n);
      for (let i = 0, v = 0; i < n; i++) {
        v = (v + (bytes[at + i] | bytes[at + n + i] << 8 | bytes[at + 2 * n + i] << 16
          | bytes[at + 3 * n + i] << 24)) | 0;
        values[i] = v === MISSING ? NaN : origin + v * step;
      }
      at += 4 * n;
      return values;
    });
  }

  /* First place whose value is not below v. */
  function place(xs, v) {
    let low = 0, high = xs.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (xs[middle] < v) low = middle + 1; else high = middle;
    }
    return low;
  }

  function shown(u, xs) {
    const { min, max } = u.scales.x;
    return [Math.max(place(xs, min) - 1, 0), Math.min(place(xs, max) + 1, xs.length)];
  }

  /* ---- from values to pixels of the canvas ---- */

  function ruler(u, key) {
    const { min, max, distr } = u.scales[key], b = u.bbox;
    const log = distr === 3, from = log ? Math.log(min) : min, to = log ? Math.log(max) : max;
    const size = key === "x" ? b.width : -b.height, start = key === "x" ? b.left : b.top + b.height;
    const k = size / (to - from);
    return log ? v => start + (Math.log(v) - from) * k : v => start + (v - from) * k;
  }

  /* ---- the pens: one a kind of series ---- */

  function trace(c, s, [lo, hi], X, Y, width, step) {
    c.beginPath();
    if (hi - lo > 4 * width) return strokes(c, s, lo, hi, X, Y);
    for (let i = lo, down = false, last = 0; i < hi; i++) {
      if (Number.isNaN(s.y[i])) { down = false; continue; }
      const x = X(s.x[i]), y = Y(s.y[i]);
      if (!down) c.moveTo(x, y);
      else { if (step) c.lineTo(x, last); c.lineTo(x, y); }
      down = true; last = y;
    }
    c.stroke();
  }

  /* Where many samples share a pixel: first, least, greatest and last of each column. */
  function strokes(c, s, lo, hi, X, Y) {
    let column = -1, low = 0, high = 0, end = 0, down = false;
    const flush = () => { if (column >= 0) { c.lineTo(column, low); c.lineTo(column, high); c.lineTo(column, end); } };
    for (let i = lo; i < hi; i++) {
      if (Number.isNaN(s.y[i])) { flush(); column = -1; down = false; continue; }
      const x = Math.round(X(s.x[i])), y = Y(s.y[i]);
      if (!down) { c.moveTo(x, y); down = true; }
      if (x !== column) { flush(); column = x; low = high = y; }
      low = Math.min(low, y); high = Math.max(high, y); end = y;
    }
    flush();
    c.stroke();
  }

  function dot(c, shape, x, y, r) {
    if (shape === "square") c.rect(x - r, y - r, 2 * r, 2 * r);
    else { c.moveTo(x + r, y); c.arc(x, y, r, 0, 2 * Math.PI); }
  }

  function points(c, s, [lo, hi], X, Y, ratio) {
    const stride = Math.max(1, Math.ceil((hi - lo) / MOST_POINTS));
    const r = (hi - lo > 1500 ? 1.4 : s.size || 2.6) * ratio;
    c.beginPath();
    for (let i = lo; i < hi; i += stride) {
      if (!Number.isNaN(s.y[i])) dot(c, s.shape, X(s.x[i]), Y(s.y[i]), r);
    }
    if (s.shape === "square" && hi - lo <= 1500) { c.lineWidth = 1.4 * ratio; c.stroke(); } else c.fill();
  }

  function stems(c, s, [lo, hi], X, Y, ratio) {
    c.beginPath();
    for (let i = lo; i < hi; i++) { c.moveTo(X(s.x[i]), Y(0)); c.lineTo(X(s.x[i]), Y(s.y[i])); }
    c.stroke();
    points(c, s, [lo, hi], X, Y, ratio);
  }

  function area(c, s, [lo, hi], X, Y) {
    const corner = (i, values) => {
      if (s.step && i > lo) c.lineTo(X(s.x[i]), Y(values === s.y ? s.y[i - 1] : s.y2[i]));
      c.lineTo(X(s.x[i]), Y(values[i]));
      if (s.step && values !== s.y && i > lo) c.lineTo(X(s.x[i]), Y(s.y2[i - 1]));
    };
    c.globalAlpha = s.alpha || 0.22;
    for (let i = lo; i < hi; i++) {
      const from = i;
      while (i < hi && !Number.isNaN(s.y[i])) i++;
      if (i === from) continue;
      c.beginPath();
      for (let k = from; k < i; k++) corner(k, s.y);
      for (let k = i - 1; k >= from; k--) corner(k, s.y2);
      c.fill();
    }
    c.globalAlpha = 1;
  }

  function pen(u, s, ratio) {
    const c = u.ctx, X = ruler(u, "x"), Y = ruler(u, "y");
    const range = s.kind === "curve" ? [0, s.x.length] : shown(u, s.x);
    c.strokeStyle = c.fillStyle = ink(s.colour);
    c.lineWidth = (s.width || 1.4) * ratio;
    c.setLineDash(s.dash ? [6 * ratio, 4 * ratio] : []);
    c.lineJoin = "round";
    if (s.kind === "line") trace(c, s, range, X, Y, u.bbox.width, false);
    else if (s.kind === "steps") trace(c, s, range, X, Y, u.bbox.width, true);
    else if (s.kind === "curve") trace(c, s, range, X, Y, Infinity, false);
    else if (s.kind === "points") points(c, s, range, X, Y, ratio);
    else if (s.kind === "stems") stems(c, s, range, X, Y, ratio);
    else if (s.kind === "area") area(c, s, range, X, Y);
    c.setLineDash([]);
  }

  /* ---- a group: what linked plots share ---- */

  class Group {
    constructor() { this.plots = []; this.whole = null; this.range = null; this.a = this.b = null; this.heard = []; }
    join(plot, from, to) {
      this.plots.push(plot);
      if (from < to) this.whole = this.whole
        ? [Math.min(this.whole[0], from), Math.max(this.whole[1], to)] : [from, to];
      this.range = this.whole;
    }
    show(min, max, by) {
      if (!(max > min)) return;
      this.range = [min, max];
      for (const plot of this.plots) plot.look(min, max);
      for (const hear of this.heard) hear(min, max, by);
    }
    zoom(factor, at) {
      const [min, max] = this.range;
      at = at ?? 0.5 * (min + max);
      this.show(at - (at - min) * factor, at + (max - at) * factor, "user");
    }
    move(share) { const [min, max] = this.range, d = (max - min) * share; this.show(min + d, max + d, "user"); }
    reset() { if (this.whole) this.show(...this.whole, "whole"); }
    hover(x) { for (const plot of this.plots) plot.point(x); }
    measure(x) {
      if (this.a === null || this.b !== null) [this.a, this.b] = [x, null]; else this.b = x;
      for (const plot of this.plots) plot.redraw();
    }
    clear() { this.a = this.b = null; for (const plot of this.plots) plot.redraw(); }
  }

  /* ---- one plot ---- */

  const number = v => v === null || Number.isNaN(v) ? "–" : Math.abs(v) >= 1e5 || (v && Math.abs(v) < 1e-3)
    ? v.toExponential(3) : String(+v.toPrecision(5));

  class Plot {
    constructor(host, spec, group) {
      this.host = host; this.spec = spec; this.hidden = new Set();
      this.group = group || new Group();
      host.classList.add("plot");
      host.innerHTML = "";
      const head = host.appendChild(document.createElement("figcaption"));
      head.appendChild(document.createElement("b")).textContent = spec.title;
      this.legend = head.appendChild(document.createElement("span"));
      this.box = host.appendChild(document.createElement("div"));
      this.entries = spec.series.map(s => this.entry(s));
      const [from, to] = this.extent();
      this.group.join(this, from, to);
      this.look(...(this.group.range || [from, to]));
      this.u = new uPlot(this.options(), [[from, to], [0, 1]], this.box);
      this.touch();
      all.add(this);
      new ResizeObserver(() => this.fit()).observe(this.box);
    }

    entry(s) {
      if (!s.label) return null;
      const item = this.legend.appendChild(document.createElement("button"));
      item.innerHTML = `<i class="${s.shape || s.kind}"></i><span></span><output></output>`;
      item.querySelector("i").style.color = `var(--${s.colour})`;
      item.querySelector("span").textContent = s.label;
      item.title = "show or hide";
      item.onclick = () => {
        for (const other of this.spec.series) {
          if (other === s || (!other.label && other.of === s.label)) {
            this.hidden.has(other) ? this.hidden.delete(other) : this.hidden.add(other);
          }
        }
        item.classList.toggle("off", this.hidden.has(s));
        this.look(...this.group.range);
      };
      return item;
    }

    extent() {
      if (this.spec.extent) return this.spec.extent;
      let from = Infinity, to = -Infinity;
      for (const s of this.spec.series) {
        if (s.kind === "curve") for (const x of s.x) { from = Math.min(from, x); to = Math.max(to, x); }
        else if (s.x.length) { from = Math.min(from, s.x[0]); to = Math.max(to, s.x[s.x.length - 1]); }
      }
      return from < to ? [from, to] : [0, 1];
    }

    options() {
      const axis = (label, size) => ({
        label, labelSize: 18, labelFont: "12px system-ui, sans-serif", font: "11.5px system-ui, sans-serif",
        size, stroke: () => ink("soft"), grid: { stroke: () => ink("grid"), width: 1 },
        ticks: { show: false } });
      const x = axis(this.spec.x, 32), y = axis(this.spec.y, 56);
      const lanes = this.spec.bare || (this.spec.lanes || []).some(lane => lane.label);
      if (lanes) y.size = 88;
      x.values = (u, ticks) => ticks.map(v => v === null ? "" : String(+v.toPrecision(7)));
      y.values = (u, ticks) => x.values(u, ticks.map(v => this.spec.bare || (lanes && v < this.foot) ? null : v));
      if (this.spec.names) { y.splits = () => this.spec.names.map((_, i) => i); y.values = () => this.spec.names; y.size = 90; }
      return {
        width: this.box.clientWidth || 600, height: this.height(), legend: { show: false },
        scales: { x: { time: false, distr: this.spec.log_x ? 3 : 1, range: () => this.window },
                  y: { distr: this.spec.log_y ? 3 : 1, range: () => this.limits } },
        axes: [x, y], series: [{}, { auto: false, paths: () => null, points: { show: false } }],
        cursor: { points: { show: false }, drag: { x: true, y: false, setScale: false, dist: 6 }, y: !!this.spec.square },
        hooks: {
          draw: [u => this.draw(u)],
          setSelect: [u => this.select(u)],
          setCursor: [u => { if (u.cursor.event || u.cursor.left >= 0) this.hovered(u); }] } };
    }

    height() { return (this.spec.height || 240) + LANE * (this.spec.lanes || []).length; }
    fit(always) {
      const width = this.box.clientWidth;
      if (width && (always || Math.abs(width - this.u.width) > 1)) this.u.setSize({ width, height: this.height() });
    }
    remove() { all.delete(this); this.group.plots = this.group.plots.filter(plot => plot !== this); this.u.destroy(); }

    select(u) {
      const { left, width } = u.select;
      if (width < 6) return;
      u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      this.group.show(u.posToVal(left, "x"), u.posToVal(left + width, "x"), "user");
    }

    touch() {
      const over = this.u.over || this.u.root.querySelector(".u-over");
      let down = null, spread = 0;
      over.addEventListener("mousedown", e => { down = e.clientX; });
      over.addEventListener("mouseup", e => {
        if (down !== null && Math.abs(e.clientX - down) < 4 && !this.spec.square) this.group.measure(this.at(e, over));
        down = null;
      });
      over.addEventListener("dblclick", () => { this.group.clear(); this.group.reset(); });
      over.addEventListener("wheel", e => {
        if (!e.ctrlKey && !e.shiftKey) return;
        e.preventDefault();
        e.shiftKey ? this.group.move(Math.sign(e.deltaY + e.deltaX) * 0.1)
          : this.group.zoom(e.deltaY > 0 ? 1.25 : 0.8, this.at(e, over));
      }, { passive: false });
      over.addEventListener("mouseleave", () => this.group.hover(null));
      over.addEventListener("touchmove", e => {
        if (e.touches.length === 1) return this.group.hover(this.at(e.touches[0], over));
        e.preventDefault();
        const [p, q] = e.touches, now = Math.abs(p.clientX - q.clientX) + 1;
        if (spread) this.group.zoom(spread / now, this.at({ clientX: (p.clientX + q.clientX) / 2 }, over));
        spread = now;
      }, { passive: false });
      over.addEventListener("touchend", () => { spread = 0; });
    }
    at(e, over) { return this.u.posToVal(e.clientX - over.getBoundingClientRect().left, "x"); }
    hovered(u) { if (u.cursor.left >= 0 && !this.pointed) this.group.hover(u.posToVal(u.cursor.left, "x")); }

    /* Show a range of x; the range of y follows what is in it. */
    look(min, max) {
      this.window = [min, max];
      this.limits = this.range(min, max);
      if (this.u) this.u.setScale("x", { min, max });
    }

    range(min, max) {
      let low = Infinity, high = -Infinity;
      const meet = v => { if (v < low) low = v; if (v > high) high = v; };
      for (const s of this.spec.series) {
        if (this.hidden.has(s) || s.aside) continue;
        const [lo, hi] = s.kind === "curve" ? [0, s.x.length]
          : [Math.max(place(s.x, min) - (s.kind === "points" ? 0 : 1), 0), place(s.x, max)];
        for (let i = lo; i < hi; i++) { meet(s.y[i]); if (s.y2) meet(s.y2[i]); }
        if (s.kind === "stems") meet(0);
      }
      if (this.spec.low !== undefined && this.spec.low !== null) low = this.spec.low;
      if (this.spec.high !== undefined && this.spec.high !== null) high = this.spec.high;
      if (!(low <= high)) [low, high] = [0, 1];
      if (this.spec.log_y) return [Math.max(low, 1e-6) / 1.3, high * 1.3];
      const room = (high - low) * 0.06 || Math.abs(high) * 0.02 || 0.5;
      const lanes = (this.spec.lanes || []).length * LANE, height = this.height() - 50;
      this.foot = low - 0.5 * room;
      const below = (this.spec.low === undefined || this.spec.low === null ? room : 0)
        + (high - low + 2 * room) * lanes / Math.max(height - lanes, 1);
      return [low - below, high + (this.spec.high === undefined || this.spec.high === null ? room : 0)];
    }

    redraw() { this.u.redraw(false); }

    draw(u) {
      const c = u.ctx, ratio = devicePixelRatio || 1, b = u.bbox;
      c.save();
      c.beginPath(); c.rect(b.left, b.top, b.width, b.height); c.clip();
      for (const s of this.spec.series) if (!this.hidden.has(s)) pen(u, s, ratio);
      this.lanes(u, ratio);
      this.marks(u, ratio);
      this.measured(u, ratio);
      c.restore();
      this.laneNames(u, ratio);
    }

    marks(u, ratio) {
      const c = u.ctx, X = ruler(u, "x"), b = u.bbox, ends = [];
      c.font = `${11 * ratio}px system-ui, sans-serif`;
      c.textBaseline = "top"; c.textAlign = "left";
      for (const m of this.spec.marks || []) {
        const x = X(m.x);
        if (x < b.left - 1 || x > b.left + b.width + 1) continue;
        c.strokeStyle = c.fillStyle = ink(m.colour || "event");
        c.setLineDash([4 * ratio, 3 * ratio]); c.lineWidth = ratio;
        c.beginPath(); c.moveTo(x, b.top); c.lineTo(x, b.top + b.height); c.stroke();
        if (!m.label || this.spec.unlabelled) continue;
        const width = c.measureText(m.label).width + 8 * ratio;
        const left = x + width > b.left + b.width ? x - width : x + 4 * ratio;
        let row = ends.findIndex(end => end <= left);
        if (row < 0) row = ends.length;
        if (row > 3) continue;
        ends[row] = left + width;
        c.fillText(m.label, left, b.top + (2 + 14 * row) * ratio);
      }
      c.setLineDash([]);
    }

    /* Rows at the foot: lines that are high, or modes, over time. */
    lanes(u, ratio) {
      const c = u.ctx, X = ruler(u, "x"), b = u.bbox, rows = this.spec.lanes || [];
      c.font = `${10 * ratio}px system-ui, sans-serif`; c.textBaseline = "middle"; c.textAlign = "left";
      rows.forEach((lane, i) => {
        const top = b.top + b.height - (rows.length - i) * LANE * ratio, height = (LANE - 3) * ratio;
        c.strokeStyle = ink("grid"); c.lineWidth = ratio;
        c.beginPath(); c.moveTo(b.left, top + height); c.lineTo(b.left + b.width, top + height); c.stroke();
        const k = Math.max(place(lane.to, u.scales.x.min), 0);
        for (let j = k; j < lane.from.length && lane.from[j] <= u.scales.x.max; j++) {
          const x = X(lane.from[j]), wide = Math.max(X(lane.to[j]) - x, 1.2 * ratio);
          c.fillStyle = ink(lane.colours ? lane.colours[j] : lane.colour);
          c.globalAlpha = lane.labels ? 0.35 : 0.9;
          c.fillRect(x, top, wide, height);
          c.globalAlpha = 1;
          if (lane.labels) this.word(c, lane.labels[j], Math.max(x, b.left) + 4 * ratio, top + height / 2,
            Math.min(x + wide, b.left + b.width) - Math.max(x, b.left), ratio);
        }
      });
    }

    laneNames(u, ratio) {
      const c = u.ctx, b = u.bbox, rows = this.spec.lanes || [];
      c.font = `${10 * ratio}px system-ui, sans-serif`; c.textBaseline = "middle"; c.textAlign = "right";
      c.fillStyle = ink("soft");
      rows.forEach((lane, i) => c.fillText(lane.label, b.left - 6 * ratio,
        b.top + b.height - ((rows.length - i) * LANE - (LANE - 3) / 2) * ratio));
    }
    word(c, text, x, y, room, ratio) {
      if (c.measureText(text).width + 8 * ratio > room) return;
      c.fillStyle = ink("ink");
      c.fillText(text, x, y);
    }

    measured(u, ratio) {
      const { a, b } = this.group, c = u.ctx, X = ruler(u, "x");
      if (this.spec.square) return;
      c.font = `${11 * ratio}px system-ui, sans-serif`; c.textBaseline = "bottom"; c.textAlign = "left";
      for (const [name, x] of [["A", a], ["B", b]]) {
        if (x === null) continue;
        c.strokeStyle = c.fillStyle = ink("ink"); c.lineWidth = 1.2 * ratio;
        c.beginPath(); c.moveTo(X(x), u.bbox.top); c.lineTo(X(x), u.bbox.top + u.bbox.height); c.stroke();
        const d = b !== null && name === "B" ? ` Δ ${number(b - a)}, 1/Δ ${number(1 / Math.abs(b - a))}` : "";
        c.fillText(name + d, X(x) + 4 * ratio, u.bbox.top + u.bbox.height - LANE * (this.spec.lanes || []).length * ratio);
      }
    }

    /* Values under the cursor, or between A and B, into the legend. */
    point(x) {
      if (this.spec.square) return;
      this.pointed = true;
      this.u.setCursor(x === null ? { left: -10, top: -10 } : { left: this.u.valToPos(x, "x"), top: 10 });
      this.pointed = false;
      const { a, b } = this.group;
      this.spec.series.forEach((s, i) => {
        if (!this.entries[i] || s.kind === "area") return;
        const told = b !== null ? "Δ " + number(this.value(s, b) - this.value(s, a))
          : x === null ? "" : number(this.value(s, x));
        this.entries[i].querySelector("output").textContent = told;
      });
    }
    value(s, x) {
      if (!s.x.length) return NaN;
      const at = place(s.x, x), before = Math.max(at - 1, 0), after = Math.min(at, s.x.length - 1);
      if (s.kind === "steps") return s.y[s.x[after] === x ? after : before];
      return s.y[x - s.x[before] < s.x[after] - x ? before : after];
    }
  }

  const groups = new Map();
  function group(name) {
    if (!name) return new Group();
    if (!groups.has(name)) groups.set(name, new Group());
    return groups.get(name);
  }

  function restyle() { inks = new Map(); for (const plot of all) plot.u.redraw(true, true); }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
  matchMedia("print").addEventListener("change", restyle);

  /* A page with embedded plots: `figure[data-plot]` are the hosts. */
  async function page(sheet) {
    const columns = await unpack(sheet);
    const arrays = item => {
      for (const key of ["x", "y", "y2", "from", "to"]) if (typeof item[key] === "number") item[key] = columns[item[key]];
      return item;
    };
    for (const host of document.querySelectorAll("figure[data-plot]")) {
      const spec = sheet.plots[+host.dataset.plot];
      spec.series.forEach(arrays);
      (spec.lanes || []).forEach(arrays);
      new Plot(host, spec, group(spec.group));
    }
    document.documentElement.dataset.drawn = Math.round(performance.now());
  }

  /* Buttons of a group: `nav[data-group]`, with places to go to (data-go="from to"). */
  function controls() {
    for (const bar of document.querySelectorAll("nav[data-group]")) {
      bar.addEventListener("click", e => {
        const button = e.target.closest("button"), g = group(bar.dataset.group);
        if (!button) return;
        const { go, act } = button.dataset;
        if (go) g.show(...go.split(" ").map(Number), "user");
        else if (act === "in") g.zoom(0.5);
        else if (act === "out") g.zoom(2);
        else if (act === "left") g.move(-0.5);
        else if (act === "right") g.move(0.5);
        else { g.clear(); g.reset(); }
      });
    }
  }

  return { Plot, Group, group, page, controls, unpack, place, ink, number };
})();
