// The line of readings at the top, and the table of statistics and cursor values.

import { digits, quantity, unitFor } from "./numbers.js";

const element = (id) => document.getElementById(id);

export function showStatus(status, traces) {
  const state = element("state"), fault = element("fault");
  state.textContent = status.stopping ? `${status.state}, stopping` : status.state;
  state.className = `chip ${status.powered ? "good" : /fault|undefined|unknown/.test(status.state) ? "bad" : ""}`;
  fault.hidden = !status.fault; fault.textContent = status.fault ?? "";
  const newest = status.newest ?? {}, find = (test) => traces.find((trace) => trace.name in newest && test(trace));
  const position = find((trace) => trace.panel === "position" && trace.role.startsWith("measured"));
  const error = find((trace) => trace.name === "following_error_m");
  const pull = find((trace) => ["torque", "force"].includes(trace.panel) && trace.role === "measured");
  const told = [position, error, pull].filter(Boolean).map((trace) => [
    trace === error ? "following error" : trace.panel, quantity(newest[trace.name], trace.unit, 4)]);
  const late = status.lateness_s;
  if (late) told.push(["late p50 / p99 / max", `${["p50", "p99", "max"].map((key) => digits(late[key] * 1e6, 3)).join(" / ")} µs`]);
  if (status.skipped) told.push(["ticks left out", String(status.skipped)]);
  if (status.bus_load !== undefined && status.bus_load !== null) told.push(["bus", `${digits(100 * status.bus_load, 2)} %`]);
  if (status.progress !== null && status.progress !== undefined) told.push(["done", `${Math.round(100 * status.progress)} %`]);
  element("readings").replaceChildren(...told.map(([name, value]) => {
    const pair = document.createElement("div");
    pair.append(Object.assign(document.createElement("dt"), { textContent: name }),
      Object.assign(document.createElement("dd"), { textContent: value, className: "wide" }));
    return pair;
  }));
}

// measured: answer of the server; cursors: times of A and B on the axis, null without; reversed: B is before A.
export function showMeasured(measured, traces, cursors, reversed) {
  element("measuredTitle").textContent = cursors ? "Cursors, and statistics between them" : "Statistics of the window";
  const length = measured.to_s - measured.from_s;
  element("between").textContent = cursors
    ? `A ${quantity(cursors[0], "s", 5)}, B ${quantity(cursors[1], "s", 5)}: B − A ${quantity(cursors[1] - cursors[0], "s", 5)}, ${digits(1 / Math.abs(cursors[1] - cursors[0]), 4)} Hz`
    : `${quantity(length, "s", 4)}, ${measured.rows} rows`;
  const heads = [...(cursors ? ["A", "B", "B − A"] : []), "mean", "std", "rms", "min", "max", "p-p"];
  const rows = [];
  let panel = "";
  for (const trace of traces.filter((one) => one.name in measured.traces)) {
    const values = measured.traces[trace.name];
    const { factor, name } = unitFor(trace.unit, Math.max(Math.abs(values.min), Math.abs(values.max)));
    if (trace.panel !== panel) {
      panel = trace.panel;
      const cell = Object.assign(document.createElement("td"), { textContent: panel, colSpan: heads.length + 2 });
      const group = document.createElement("tr");
      group.className = "group"; group.append(cell); rows.push(group);
    }
    const [a, b] = reversed ? [values.last, values.first] : [values.first, values.last];
    const shown = [...(cursors ? [a, b, b - a] : []), values.mean, values.std, values.rms, values.min, values.max, values.span];
    const row = document.createElement("tr");
    row.dataset.trace = trace.name;
    row.append(...[trace.label, name, ...shown.map((value) => digits(value * factor))].map((text) =>
      Object.assign(document.createElement("td"), { textContent: text })));
    rows.push(row);
  }
  const table = document.createElement("table"), head = document.createElement("thead"), body = document.createElement("tbody");
  head.append(Object.assign(document.createElement("tr"), { innerHTML: ["", "", ...heads].map((text) => `<th>${text}</th>`).join("") }));
  body.append(...rows); table.append(head, body);
  element("measured").replaceChildren(table);
}
