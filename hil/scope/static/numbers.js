// Numbers as engineers read them. The units of each SI unit come from the server: [from this magnitude on, factor, name].

let units = {};
export const setUnits = (given) => { units = given; };

export function unitFor(si, largest) {
  const choices = units[si] ?? [[0, 1, si]];
  const [, factor, name] = choices.find(([from]) => Math.abs(largest) >= from) ?? choices[choices.length - 1];
  return si === "1" ? { factor: 1, name: "" } : { factor, name };
}

// Keeps the unit until the values have clearly left its range: a panel must not change it with every frame.
export function steadyUnit(si, largest, before) {
  const next = unitFor(si, largest);
  if (!before || next.factor < before.factor) return next;
  return unitFor(si, largest * 2.5).factor > before.factor ? next : before;
}

// The unit is chosen so that a small number is next to nothing: at most `significant` decimals.
export function digits(value, significant = 4) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1e6) return value.toExponential(significant - 1);
  const decimals = significant - 1 - Math.floor(Math.log10(Math.max(size, 1)));
  const text = value.toFixed(Math.max(0, decimals));
  return Number(text) === 0 ? "0" : text.replace("-", "−");
}

export function quantity(value, si, significant = 4) {
  if (value === undefined || value === null) return "–";
  const { factor, name } = unitFor(si, value);
  return `${digits(value * factor, significant)} ${name}`.trim();
}

const STATES = ["not ready", "disabled", "ready", "switched on", "enabled", "quick stop", "fault reaction", "fault"];
export const stateName = (number) => STATES[number] ?? (number === -1 ? "unknown" : "");
