// Points on the page: those of the rows that roll or rest, and those of the second recording.

const LEAST_S = 1e-4; // of the time axis

export class Store {
  constructor() { this.clear(); }

  clear() {
    this.names = []; this.rows = [new Float64Array()]; this.zero = 0; this.still = false; this.window = 1;
    this.second = null;
  }

  view(frame) {
    this.names = frame.traces; this.rows = frame.rows; this.zero = frame.zero_s; this.still = frame.still;
    this.window = frame.window_s ?? this.window;
    if (!frame.still) this.second = null;
  }

  append(frame) {
    if (this.still || frame.traces.join() !== this.names.join()) return;
    const times = this.rows[0], come = frame.rows[0];
    const oldest = come[come.length - 1] - this.window;
    let drop = 0;
    while (drop < times.length && times[drop] < oldest) drop += 1;
    this.rows = this.rows.map((row, index) => {
      const joined = new Float64Array(row.length - drop + come.length);
      joined.set(row.subarray(drop));
      joined.set(frame.rows[index], row.length - drop);
      return joined;
    });
  }

  // Times of the first and the last point, from the trigger on if there is one.
  get extent() {
    const times = this.rows[0];
    if (!times.length) return [0, this.window];
    const first = times[0] - this.zero;
    return [first, Math.max(times[times.length - 1] - this.zero, first + LEAST_S)];
  }

  // Time axis as drawn.
  get range() {
    const [first, last] = this.extent;
    return this.still ? [first, last] : [last - this.window, last];
  }

  // Data of uPlot for traces in the unit with this factor; with `second` those of the second recording follow.
  data(names, factor, second) {
    const pick = (rows, all) => {
      const at = (name) => rows[1 + all.indexOf(name)];
      const scaled = (row) => (factor === 1 ? row : row.map((value) => value * factor));
      const times = this.zero ? rows[0].map((time) => time - this.zero) : rows[0];
      return [times, ...names.map((name) => (all.includes(name) ? scaled(at(name)) : new Array(times.length).fill(null)))];
    };
    const first = pick(this.rows, this.names);
    if (!second) return first;
    return uPlot.join([first, this.second ? pick(this.second.rows, this.second.traces) : [[], ...names.map(() => [])]]);
  }

  // Greatest magnitude of traces [SI], in both recordings.
  largest(names) {
    let most = 0;
    for (const { traces, rows } of [{ traces: this.names, rows: this.rows }, ...(this.second ? [this.second] : [])]) {
      for (const name of names.filter((one) => traces.includes(one))) {
        for (const value of rows[1 + traces.indexOf(name)]) most = Math.max(most, Math.abs(value));
      }
    }
    return most;
  }

  last(name) {
    const row = this.rows[1 + this.names.indexOf(name)];
    return this.names.includes(name) && row.length ? row[row.length - 1] : undefined;
  }
}
