/* A report whose zoom asks the logs: signals and pulses of the range that is shown, in full where a
   screen can show them, else the least and greatest of each stretch (bench/panel/view.py). */
"use strict";
{
  const group = Plots.group("time"), embedded = new Map();
  let timer = 0, number = 0;
  const address = (from, to, names) => `/window${location.search}&from=${from}&to=${to}&signals=${names.join()}`;
  const traces = () => group.plots.flatMap(plot => plot.spec.series.filter(s => s.signal).map(s => [plot, s]));

  function keep(s, keys) { if (!embedded.has(s)) embedded.set(s, Object.fromEntries(keys.map(k => [k, s[k]]))); }
  function restore() {
    for (const [s, kept] of embedded) Object.assign(s, kept);
    for (const plot of group.plots) plot.look(...group.range);
  }
  async function ask(from, to) {
    const mine = ++number, names = [...new Set(traces().map(([, s]) => s.signal))];
    const answer = await fetch(address(from, to, names));
    if (!answer.ok || mine !== number) return;
    const sheet = await answer.json(), columns = await Plots.unpack(sheet);
    for (const [plot, s] of traces()) {
      const found = sheet.signals[s.signal];
      if (!found) continue;
      keep(s, ["x", "y"]);
      s.x = columns[found[0]];
      s.y = columns[found[1]].map(v => v * s.scale);
      for (const band of plot.spec.series) {
        if (band.of === s.label && band.kind === "area") { keep(band, ["x", "y", "y2"]); band.x = band.y = band.y2 = new Float64Array(0); }
      }
    }
    for (const plot of group.plots) {
      for (const lane of plot.spec.lanes || []) {
        const found = sheet.lanes[lane.label];
        if (found) { keep(lane, ["from", "to"]); [lane.from, lane.to] = found.map(i => columns[i]); }
      }
      plot.look(...group.range);
    }
    document.documentElement.dataset.window = `${from} ${to}`;
  }
  group.heard.push((from, to, by) => {
    clearTimeout(timer);
    if (by === "whole") { number++; restore(); } else timer = setTimeout(ask, 150, from, to);
  });
}
