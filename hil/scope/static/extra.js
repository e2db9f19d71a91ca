// Amplitude spectrum and XY plot.

import { unitFor } from "./numbers.js";
import { axes, colour } from "./panels.js";

const HEIGHT = 260;
const label = (trace, unit) => (unit.name ? `${trace.label} [${unit.name}]` : trace.label);
const largest = (row) => row.reduce((most, value) => Math.max(most, Math.abs(value)), 0);

export class SpectrumPlot {
  constructor(host) { this.host = host; }

  draw(frame, trace) {
    const [frequencies, amplitudes] = frame.rows, unit = unitFor(trace.unit, largest(amplitudes));
    const data = [frequencies, amplitudes.map((value) => value * unit.factor)];
    const id = `${trace.name} ${unit.name}`;
    if (this.id === id) { this.plot.setData(data); return; }
    this.id = id;
    this.plot?.destroy();
    this.plot = new uPlot({
      width: this.host.clientWidth, height: HEIGHT, legend: { show: false }, padding: [6, 10, 0, 0],
      scales: { x: { time: false } }, cursor: { drag: { x: true, y: false } },
      series: [{}, { stroke: colour("measured"), width: 1.3, points: { show: false } }],
      axes: axes(label(trace, unit), "frequency [Hz]"),
    }, data, this.host);
  }

  clear() { this.plot?.destroy(); this.id = undefined; this.host.replaceChildren(); }
}

export class XYPlot {
  constructor(host) { this.host = host; }

  draw(frame, x, y) {
    const [xs, ys] = frame.rows, xUnit = unitFor(x.unit, largest(xs)), yUnit = unitFor(y.unit, largest(ys));
    const data = [null, [xs.map((value) => value * xUnit.factor), ys.map((value) => value * yUnit.factor)]];
    const id = [x.name, y.name, xUnit.name, yUnit.name].join();
    if (this.id === id) { this.plot.setData(data); return; }
    this.id = id;
    this.plot?.destroy();
    const range = (facet) => (u) => {
      const values = u.data[1][facet];
      let low = Infinity, high = -Infinity;
      for (const value of values) { low = Math.min(low, value); high = Math.max(high, value); }
      const margin = 0.05 * (high - low) || 1e-9;
      return [low - margin, high + margin];
    };
    const line = (u) => {
      const [px, py] = u.data[1], path = new Path2D();
      px.forEach((value, index) => {
        const at = [u.valToPos(value, "x", true), u.valToPos(py[index], "y", true)];
        index ? path.lineTo(...at) : path.moveTo(...at);
      });
      u.ctx.save();
      u.ctx.beginPath(); u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height); u.ctx.clip();
      u.ctx.strokeStyle = colour("measured"); u.ctx.lineWidth = 1.3 * devicePixelRatio; u.ctx.stroke(path);
      u.ctx.restore();
      return null;
    };
    this.plot = new uPlot({
      mode: 2, width: this.host.clientWidth, height: HEIGHT + 60, legend: { show: false }, padding: [6, 10, 0, 0],
      scales: { x: { time: false, range: range(0) }, y: { range: range(1) } }, cursor: { drag: { x: false, y: false } },
      series: [null, { facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }], paths: line }],
      axes: axes(label(y, yUnit), label(x, xUnit)),
    }, data, this.host);
  }

  clear() { this.plot?.destroy(); this.id = undefined; this.host.replaceChildren(); }
}
