// Trigger controls: source, slope, level in the unit of its panel, part of the window before it.

import { unitFor } from "./numbers.js";

const EVENTS = ["fault", "change of state", "change of segment", "stop"];
const element = (id) => document.getElementById(id);

export class TriggerControls {
  constructor(scope) {
    this.scope = scope; this.level = 0; this.again = null;
    element("source").onchange = () => this.relabel();
    element("level").oninput = () => { this.level = Number(element("level").value) / this.unit.factor; scope.redraw(); };
    element("single").onclick = () => this.arm(false);
    element("normal").onclick = () => this.arm(true);
    element("off").onclick = () => this.off();
  }

  fill(traces) {
    const before = element("source").value;
    const options = [...traces.map((trace) => [trace.name, `${trace.panel}: ${trace.label}`]),
      ...EVENTS.map((event) => [`event ${event}`, `event: ${event}`])];
    element("source").replaceChildren(...options.map(([value, text]) => new Option(text, value)));
    if (options.some(([value]) => value === before)) element("source").value = before;
    this.relabel();
  }

  get event() { const source = element("source").value; return source.startsWith("event ") ? source.slice(6) : null; }

  // Level and unit as the panel of the trace shows them.
  relabel() {
    const trace = this.scope.trace(element("source").value);
    element("slope").hidden = element("levelLabel").hidden = this.event !== null;
    this.unit = trace ? this.scope.panels.of(trace.name)?.unit ?? unitFor(trace.unit, 1) : { factor: 1, name: "" };
    element("levelUnit").textContent = this.unit.name;
    if (document.activeElement !== element("level")) element("level").value = +(this.level * this.unit.factor).toPrecision(6);
    this.scope.redraw();
  }

  arm(again) {
    const window = Number(element("window").value), part = Math.min(100, Math.max(0, Number(element("before").value))) / 100;
    const source = this.event ? { event: this.event } : { trace: element("source").value, level: this.level, slope: element("slope").value };
    this.scope.send({ do: "arm", ...source, pre_s: part * window, post_s: (1 - part) * window, again });
    this.again = again;
    this.mark();
  }

  off() { this.again = null; this.scope.send({ do: "disarm" }); this.mark(); }

  // The capture is there.
  came(again) { if (!again) this.again = null; this.mark(); }

  mark() {
    element("single").classList.toggle("on", this.again === false);
    element("normal").classList.toggle("on", this.again === true);
  }

  // Level in the panel of the trace, and the time of the trigger.
  draw(plot, panel) {
    const { ctx, bbox } = plot, ratio = devicePixelRatio, zero = plot.valToPos(0, "x", true);
    ctx.save();
    ctx.strokeStyle = this.scope.colour("bad"); ctx.lineWidth = ratio; ctx.setLineDash([5 * ratio, 4 * ratio]);
    const line = (x0, y0, x1, y1) => { ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke(); };
    if (this.scope.store.zero && zero >= bbox.left && zero <= bbox.left + bbox.width) line(zero, bbox.top, zero, bbox.top + bbox.height);
    if ((this.again !== null || this.scope.store.zero) && !this.event && panel.names.includes(element("source").value)) {
      const y = plot.valToPos(this.level * panel.unit.factor, "y", true);
      if (y >= bbox.top && y <= bbox.top + bbox.height) line(bbox.left, y, bbox.left + bbox.width, y);
    }
    ctx.restore();
  }
}
