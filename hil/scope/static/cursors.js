// Two cursors at times of the axis, moved with the mouse or a finger; they are the same in all panels.

import { colour } from "./panels.js";

const NEAR = 8; // CSS pixels at which a cursor is taken

export class Cursors {
  constructor(changed) { this.on = false; this.at = [0, 0]; this.changed = changed; }

  show(range) {
    const [low, high] = range;
    this.on = true;
    this.at = [low + (high - low) / 3, low + (2 * (high - low)) / 3];
    this.changed();
  }

  hide() { this.on = false; this.changed(); }

  attach(plot) {
    const over = plot.over;
    const nearest = (event) => {
      if (!this.on) return -1;
      const left = event.clientX - over.getBoundingClientRect().left;
      const gaps = this.at.map((time) => Math.abs(plot.valToPos(time, "x") - left));
      const index = gaps[0] <= gaps[1] ? 0 : 1;
      return gaps[index] <= NEAR ? index : -1;
    };
    let taken = -1;
    over.addEventListener("pointerdown", (event) => {
      taken = nearest(event);
      if (taken >= 0) over.setPointerCapture(event.pointerId);
    }, true);
    // before uPlot, which would begin to select a stretch
    over.addEventListener("mousedown", (event) => { if (nearest(event) >= 0 || taken >= 0) event.stopImmediatePropagation(); }, true);
    over.addEventListener("pointermove", (event) => {
      over.classList.toggle("grab", taken >= 0 || nearest(event) >= 0);
      if (taken < 0) return;
      this.at[taken] = plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
      this.changed();
    });
    over.addEventListener("pointerup", () => { taken = -1; });
  }

  draw(plot) {
    if (!this.on) return;
    const { ctx, bbox } = plot, ratio = devicePixelRatio;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = colour("cursor");
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.lineWidth = 1.5 * ratio;
    ctx.font = `${11 * ratio}px system-ui, sans-serif`;
    this.at.forEach((time, index) => {
      const x = plot.valToPos(time, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) return;
      ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke();
      ctx.fillText("AB"[index], x + 3 * ratio, bbox.top + 11 * ratio);
    });
    ctx.restore();
  }
}
