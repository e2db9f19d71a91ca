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
    trace === error ? "following error" : trace.panel, quantity(newest[trace.name], trace.unit, 4), "moving"]);
  const late = status.lateness_s;
  if (late) told.push(["late p50 / p99 / max", `${["p50", "p99", "max"].map((key) => Math.round(late[key] * 1e6)).join(" / ")} µs`]);
  if (status.skipped) told.push(["ticks left out", String(status.skipped)]);
  if (status.bus_load !== undefined && status.bus_load !== null) told.push(["bus", `${digits(100 * status.bus_load, 2)} %`]);
  if (status.progress !== null && status.progress !== undefined) told.push(["done", `${Math.round(100 * status.progress)} %`]);
  element("readings").replaceChildren(...told.map(([name, value, className]) => {
    const pair = document.createElement("div");
    pair.append(Object.assign(document.createElement("dt"), { textContent: name }),
      Object.assign(document.createElement("dd"), { textContent: value, className: className ?? "" }));
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
  const table = (heads, values) => {
    const rows = [];
    let panel = "";
    for (const trace of traces.filter((one) => one.name in measured.traces)) {
      const all = measured.traces[trace.name];
      const { factor, name } = unitFor(trace.unit, Math.max(Math.abs(all.min), Math.abs(all.max)));
      if (trace.panel !== panel) rows.push(row("group", [(panel = trace.panel)], heads.length + 2));
      rows.push(row("", [trace.label, name, ...values(all).map((value) => digits(value * factor))]));
      rows[rows.length - 1].dataset.trace = trace.name;
    }
    const made = make("table"), head = make("thead"), body = make("tbody");
    const names = make("tr");
    names.append(...["", "", ...heads].map((text) => make("th", text)));
    head.append(names); body.append(...rows); made.append(head, body);
    return made;
  };
  const ends = ({ first, last }) => (reversed ? [last, first, first - last] : [first, last, last - first]);
  const tables = cursors ? [table(["A", "B", "B − A"], ends)] : [];
  tables.push(table(["mean", "std", "rms", "min", "max", "p-p"], (all) => [all.mean, all.std, all.rms, all.min, all.max, all.span]));
  element("measured").replaceChildren(...tables);
}

const make = (tag, textContent = "") => Object.assign(document.createElement(tag), { textContent });

function row(className, texts, colSpan = 1) {
  const made = make("tr");
  made.className = className;
  made.append(...texts.map((text) => Object.assign(make("td", text), { colSpan })));
  return made;
}
