// The page: what the user does becomes messages, what the server sends becomes pictures. It has no way to the axis.

import { Cursors } from "./cursors.js";
import { SpectrumPlot, XYPlot } from "./extra.js";
import { connect, query } from "./link.js";
import { setUnits } from "./numbers.js";
import { colour, Panels } from "./panels.js";
import { showMeasured, showStatus } from "./readings.js";
import { Store } from "./store.js";
import { TriggerControls } from "./trigger.js";

const element = (id) => document.getElementById(id);
const SHOWN = ["position", "motor position", "following error", "position, measured less twin", "motor position, measured less twin",
  "torque", "force", "torque, measured less twin", "force, measured less twin", "loop"];
const MEASURE_MS = 500;

const scope = {
  store: new Store(), traces: [], chosen: new Set(), known: new Set(), run: null, mode: "", colour, dirty: false, moved: false,

  trace(name) { return this.traces.find((trace) => trace.name === name); },
  get shown() { return this.traces.filter((trace) => this.chosen.has(trace.name)); },
  timeLabel() { return this.store.zero ? "time from the trigger [s]" : "time [s]"; },
  redraw() { this.dirty = true; },

  see() {
    this.send({ do: "see", traces: this.shown.map((trace) => trace.name), window_s: Number(element("window").value),
      points: Math.min(4000, Math.round(2 * this.panels.width)), shift_s: Number(element("shift").value) || 0 });
  },
  choose(name, on) {
    on ? this.chosen.add(name) : this.chosen.delete(name);
    fillTraces();
    this.rebuild();
    this.see();
  },
  rebuild() { this.panels.build(this.shown, (this.run?.recordings.length ?? 0) > 1); this.redraw(); },
  zoom(from, to) { this.send({ do: "show", from_s: from + this.store.zero, to_s: to + this.store.zero }); },
  everything() { this.send({ do: "show" }); },
  // Stretch of time that is measured and saved: between the cursors, or what is seen.
  stretch() {
    const [from, to] = this.cursors.on ? [Math.min(...this.cursors.at), Math.max(...this.cursors.at)] : this.store.range;
    return this.cursors.on || this.store.still ? { from_s: from + this.store.zero, to_s: to + this.store.zero } : {};
  },
  drawOver(plot, panel) { this.trigger.draw(plot, panel); this.cursors.draw(plot); },
};

function say(text, bad = false) {
  const message = element("message");
  message.textContent = text; message.hidden = !text; message.className = bad ? "bad" : "";
}

function fillTraces() {
  const parts = [];
  let panel = "";
  for (const trace of scope.traces) {
    if (trace.panel !== panel) { panel = trace.panel; parts.push(Object.assign(document.createElement("b"), { textContent: panel })); }
    const label = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox" });
    box.checked = scope.chosen.has(trace.name);
    box.onchange = () => scope.choose(trace.name, box.checked);
    label.append(box, ` ${trace.label}`);
    parts.push(label);
  }
  element("traces").replaceChildren(...parts);
}

function fillSelect(id, wanted) {
  const select = element(id), before = select.value;
  select.replaceChildren(...scope.traces.map((trace) => new Option(`${trace.panel}: ${trace.label}`, trace.name)));
  select.value = scope.trace(before) ? before : wanted ?? scope.traces[0]?.name;
}

const inPanel = (name, role) => scope.traces.find((trace) => trace.panel === name && trace.role.startsWith(role))?.name;

const on = {
  connected(yes) {
    if (yes) { say(""); return; }
    say("no connection to hil scope; trying again", true);
    element("state").textContent = "not connected"; element("state").className = "chip bad";
  },
  rows(run) {
    scope.run = run; scope.store.clear(); scope.traces = run.traces;
    setUnits(run.units);
    for (const trace of run.traces.filter((one) => !scope.known.has(one.name))) {
      scope.known.add(trace.name);
      if (SHOWN.includes(trace.panel)) scope.chosen.add(trace.name);
    }
    element("name").textContent = [run.recordings.length > 1 ? `${run.recordings[0]}, dashed: ${run.recordings[1]}` : run.name, run.bench && `bench ${run.bench}`,
      `${+(1e3 * run.period_s).toPrecision(4)} ms`].filter(Boolean).join(" · ");
    element("replay").hidden = run.live; element("shiftLabel").hidden = run.recordings.length < 2;
    element("saving").hidden = !run.saves;
    fillTraces();
    fillSelect("fftTrace", inPanel("following error", "commanded")); fillSelect("xyX", inPanel("position", "measured"));
    fillSelect("xyY", inPanel("torque", "measured"));
    scope.rebuild();
    scope.trigger.fill(scope.traces);
    scope.see();
  },
  view(frame) { const label = scope.timeLabel(); scope.store.view(frame); if (label !== scope.timeLabel()) scope.panels.restyle(); scope.moved = true; scope.redraw(); },
  append(frame) { scope.store.append(frame); scope.redraw(); },
  second(frame) { scope.store.second = frame; scope.redraw(); },
  status(status) {
    scope.mode = status.mode;
    showStatus(status, scope.traces);
    const rolling = scope.mode === "rolling", words = { rolling: scope.run.live ? "live" : "replay", held: scope.run.live ? "held" : "recording", waiting: "waiting for the trigger" };
    element("mode").textContent = words[scope.mode];
    element("hold").textContent = rolling ? "Hold" : "Run"; element("hold").disabled = !scope.run.live && scope.mode === "held";
    document.body.dataset.mode = scope.mode;
  },
  triggered(message) { scope.trigger.came(message.again); say(`triggered at ${message.time_s.toFixed(4)} s`); },
  measured(message) { showMeasured(message, scope.shown, scope.cursors.on ? scope.cursors.at : null, scope.cursors.at[0] > scope.cursors.at[1]); },
  spectrum(frame) { spectrum.draw(frame, scope.trace(frame.traces[0])); },
  xy(frame) { xy.draw(frame, ...frame.traces.map((name) => scope.trace(name))); },
  refused(message) { say(message.text, true); if (scope.mode !== "waiting") scope.trigger.came(false); },
};

scope.panels = new Panels(element("plots"), scope);
scope.cursors = new Cursors(() => { scope.moved = true; scope.redraw(); });
scope.trigger = new TriggerControls(scope);
scope.send = connect(on);
const spectrum = new SpectrumPlot(element("fftPlot")), xy = new XYPlot(element("xyPlot"));
const extra = { fft: false, xy: false };

function ask() {
  if (!scope.run || !scope.store.rows[0].length) return;
  const stretch = scope.stretch();
  scope.send({ do: "measure", ...stretch });
  if (extra.fft) scope.send({ do: "spectrum", trace: element("fftTrace").value, ...stretch });
  if (extra.xy) scope.send({ do: "xy", x: element("xyX").value, y: element("xyY").value, ...stretch });
  scope.moved = false;
}
setInterval(() => { if (scope.moved || scope.mode === "rolling") ask(); }, MEASURE_MS);

function frame() {
  requestAnimationFrame(frame); // first: an error in a picture must not be the last one
  if (scope.dirty) { scope.dirty = false; scope.panels.draw(); }
}
frame();

const hold = () => { say(""); scope.send({ do: "hold", on: scope.mode === "rolling" }); scope.trigger.came(false); };
function cursors() {
  if (scope.cursors.on) scope.cursors.hide();
  else { if (scope.mode === "rolling") hold(); scope.cursors.show(scope.store.extent); }
  element("cursors").classList.toggle("on", scope.cursors.on);
}
function toggle(name, section, plot) {
  extra[name] = !extra[name];
  element(name).classList.toggle("on", extra[name]); element(section).hidden = !extra[name];
  plot.clear(); ask();
}
async function save() {
  const body = JSON.stringify({ page: scope.run.page, name: element("saveName").value, ...scope.stretch() });
  const answer = await (await fetch(`/save${query}`, { method: "POST", body })).json();
  if (answer.refused) say(answer.refused, true);
  else say(`saved ${answer.rows} rows: ${answer.path}; next: hil compare ${answer.path}`);
}

element("hold").onclick = hold;
element("everything").onclick = () => scope.everything();
element("window").onchange = element("shift").onchange = () => scope.see();
element("cursors").onclick = cursors;
element("fft").onclick = () => toggle("fft", "extraFFT", spectrum);
element("xy").onclick = () => toggle("xy", "extraXY", xy);
element("fftTrace").onchange = () => { spectrum.clear(); ask(); };
element("xyX").onchange = element("xyY").onchange = () => { xy.clear(); ask(); };
element("play").onclick = () => scope.send({ do: "play", from_s: scope.store.rows[0][0] ?? 0, speed: Number(element("speed").value) });
element("save").onclick = save;
document.onkeydown = (event) => {
  if (/INPUT|SELECT|BUTTON|SUMMARY/.test(event.target.tagName) || event.ctrlKey || event.metaKey) return;
  const action = { " ": hold, c: cursors, t: () => scope.trigger.arm(false) }[event.key];
  if (action) { event.preventDefault(); action(); }
};
document.onclick = (event) => { if (!element("choose").contains(event.target)) element("choose").open = false; };
new ResizeObserver(() => scope.panels.resize()).observe(element("plots"));
window.onresize = () => scope.panels.resize();
matchMedia("(prefers-color-scheme: dark)").onchange = () => { scope.panels.restyle(); spectrum.clear(); xy.clear(); scope.redraw(); ask(); };
window.scope = scope; // for the console and the tests
