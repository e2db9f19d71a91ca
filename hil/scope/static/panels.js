// One plot for each panel over a common time axis; the keys stand above the plot, so that they never cover data.

import { digits, stateName, steadyUnit, unitFor } from "./numbers.js";

const LEAST = 104, MOST = 260, SMALL = 96, HEAD = 24, TIMES = 42, AXIS = 62; // CSS pixels
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const LEAST_MARGIN = 1e-3; // in the unit shown; uPlot finds no ticks in ranges as small as rounding errors

// What is measured lies broad under the others, so that all of them are seen where they are equal.
const WIDTH = { measured: 3.4, "measured 2": 3.4, twin: 1.6, "twin 2": 1.6, commanded: 1 };
const ORDER = ["measured", "measured 2", "loop", "twin", "twin 2", "commanded"];
const variable = (role) => role.replace(" ", "-");

export function axes(unit, timeLabel, last = true) {
  const ink = colour("soft"), grid = { stroke: colour("grid"), width: 1 }, font = "12px system-ui, sans-serif";
  const common = { stroke: ink, grid, ticks: { ...grid, size: 4 }, font, labelFont: font };
  return [
    last ? { ...common, label: timeLabel, labelSize: 18, size: 24 } : { ...common, values: () => [], size: 6 },
    { ...common, label: unit, size: AXIS - 18, labelSize: 18, space: 26 },
  ];
}

// Range with a margin that follows growth at once and shrinks only when much room is free.
export function steadyRange(before, low, high) {
  if (low === null || high === null || !Number.isFinite(low)) return before ?? [-1, 1];
  const margin = Math.max(0.08 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high)), LEAST_MARGIN);
  const wanted = [low - margin, high + margin];
  if (before && low >= before[0] && high <= before[1] && high - low > 0.45 * (before[1] - before[0])) return before;
  return wanted;
}

class PlotPanel {
  constructor(name, traces, host, scope) {
    traces = traces.toSorted((one, other) => ORDER.indexOf(one.role) - ORDER.indexOf(other.role));
    if (traces.length === 1 || name.includes("less twin")) traces = traces.map((trace) => ({ ...trace, thin: true }));
    this.name = name; this.traces = traces; this.scope = scope; this.si = traces[0].unit;
    this.names = traces.map((trace) => trace.name);
    this.element = document.createElement("section");
    this.element.className = "panel";
    this.element.dataset.panel = name;
    const head = document.createElement("p");
    head.append(Object.assign(document.createElement("b"), { textContent: name }));
    this.values = traces.map((trace) => this.key(head, trace));
    this.element.append(head);
    host.append(this.element);
    this.unit = unitFor(this.si, 1);
  }

  key(head, trace) {
    const key = document.createElement("button"), line = document.createElement("i"), value = document.createElement("span");
    key.className = "key"; key.title = "hide";
    line.style.borderColor = `var(--${variable(trace.role)})`;
    key.append(line, trace.label, value);
    key.onclick = () => this.scope.choose(trace.name, false);
    head.append(key);
    return value;
  }

  build(last, width, height, dashed) {
    this.plot?.destroy();
    this.dashed = dashed;
    const line = (trace, second) => ({
      label: trace.name, stroke: colour(variable(trace.role)), width: second || trace.thin ? 1.3 : WIDTH[trace.role] ?? 1.3,
      points: { show: false }, spanGaps: false, ...(second ? { dash: [6, 4] } : {}),
      ...(this.si === "1" ? { paths: uPlot.paths.stepped({ align: 1 }) } : {}),
    });
    const [x, y] = axes(this.unit.name, this.scope.timeLabel(), last);
    if (this.si === "1") { y.values = (u, splits) => splits.map((split) => (Number.isInteger(split) ? this.word(split) : "")); y.incrs = [1, 2, 5]; }
    this.plot = new uPlot({
      width, height: this.height(height, last), padding: [4, 10, 0, 0], legend: { show: false },
      scales: { x: { time: false, range: () => this.scope.store.range }, y: { range: (u, low, high) => (this.span = this.si === "1" ? [Math.min(low ?? 0, 0) - 0.5, (high ?? 1) + 0.5] : steadyRange(this.span, low, high)) } },
      cursor: { sync: { key: "scope" }, drag: { x: true, y: false, setScale: false }, points: { size: 5 } },
      series: [{}, ...this.traces.map((trace) => line(trace, false)), ...(dashed ? this.traces.map((trace) => line(trace, true)) : [])],
      axes: [x, y],
      hooks: {
        setSelect: [(u) => { if (u.select.width > 4) this.scope.zoom(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")); u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false); }],
        draw: [(u) => this.scope.drawOver(u, this)],
      },
    }, this.scope.store.data(this.names, this.unit.factor, dashed), this.element);
    this.plot.over.ondblclick = () => this.scope.everything();
    this.scope.cursors.attach(this.plot);
  }

  height(height, last) { return (this.si === "1" ? SMALL : height) + (last ? TIMES - 6 : 0); }

  word(number) { return this.name === "state" ? stateName(number) : String(number); }

  draw() {
    const unit = steadyUnit(this.si, this.scope.store.largest(this.names), this.unit);
    if (unit.name !== this.unit.name) {
      this.unit = unit; this.span = undefined;
      this.plot.axes[1].label = unit.name;
    }
    this.plot.setData(this.scope.store.data(this.names, unit.factor, this.dashed));
    const at = this.plot.cursor.idx;
    this.traces.forEach((trace, index) => {
      const value = at === null || at === undefined ? this.scope.store.last(trace.name) : this.plot.data[1 + index][at];
      const shown = at === null || at === undefined ? (value ?? NaN) * unit.factor : value;
      this.values[index].textContent = this.si === "1" ? this.word(Math.round(shown)) : digits(shown ?? NaN);
    });
  }
}

export class Panels {
  constructor(host, scope) { this.host = host; this.scope = scope; this.all = []; }

  // traces: those that are shown, in order.
  build(traces, dashed) {
    this.all.forEach((panel) => panel.plot?.destroy());
    this.host.replaceChildren();
    const names = [...new Set(traces.map((trace) => trace.panel))];
    this.all = names.map((name) => new PlotPanel(name, traces.filter((trace) => trace.panel === name), this.host, this.scope));
    this.dashed = dashed;
    this.restyle();
  }

  get width() { return Math.max(320, this.host.clientWidth); }

  // So that the panels fill the window, if they have room in it.
  get height() {
    const top = this.host.getBoundingClientRect().top + scrollY, small = this.all.filter((panel) => panel.si === "1").length;
    const room = innerHeight - top - TIMES - HEAD * this.all.length - small * SMALL - 12;
    return Math.round(Math.min(MOST, Math.max(LEAST, room / Math.max(1, this.all.length - small))));
  }

  each(act) { const height = this.height; this.all.forEach((panel, index) => act(panel, height, index === this.all.length - 1)); }

  resize() { this.each((panel, height, last) => panel.plot?.setSize({ width: this.width, height: panel.height(height, last) })); }

  restyle() { this.each((panel, height, last) => panel.build(last, this.width, height, this.dashed)); }

  draw() { this.all.forEach((panel) => panel.draw()); }

  of(trace) { return this.all.find((panel) => panel.names.includes(trace)); }
}
