// SPDX-License-Identifier: BSD-3-Clause

// -- the view -----------------------------------------------------------------------------------------------------

/**
 * A window of a layer: simdtex sends what the window shows and no more, so memory is bounded.
 * Two results side by side are two panes of one view: they show the same window.
 */
class View {
  constructor(page) {
    this.page = page;
    this.left = this.top = 0;
    observe(this, { unit: 1 }); // pixels of the screen for each of the layer
    this.fitted = true;
    this.rows = this.cols = 0;
    this.cursor = null;
    this.panes = ["view", "beside"].map((name) => this.pane(name));
    this.canvas = this.panes[0].canvas;
    this.element = make("div", { class: "panes" }, ...this.panes.map(({ canvas }) => canvas));
    this.observer = new ResizeObserver(() => this.resized());
    this.observer.observe(this.canvas);
    const follow = (read, act) => effect(() => {
      read();
      untracked(act);
    });
    follow(() => page.tiled, () => this.fit());
    follow(() => page.layer, () => this.ask());
    follow(() => [page.lattice, page.painting.brush, page.painting.visible], () => this.draw());
  }

  pane(name) {
    const label = name === "view" ? "There is no result yet." : "The result beside it.";
    const canvas = make("canvas", { class: name, tabindex: 0, role: "img", "aria-label": label, hidden: name === "beside" });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("keyup", (event) => this.held(event.key, false));
    canvas.addEventListener("blur", () => this.held("b", false));
    return { canvas, frame: null, why: null };
  }

  /** Pixels of the layer whose mean is a pixel of the frame. */
  get step() {
    return Math.max(1, Math.floor(1 / this.unit + 1e-6));
  }

  resized() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((side) => Math.round(side * ratio));
    if (!width || (width === this.canvas.width && height === this.canvas.height)) return;
    for (const { canvas } of this.panes) [canvas.width, canvas.height] = [width, height];
    if (this.fitted) this.fit();
    else this.moved();
  }

  fit() {
    this.fitted = true;
    const times = this.page.tiled ? 3 : 1;
    const room = Math.min(this.canvas.width / (times * this.cols), this.canvas.height / (times * this.rows));
    if (!this.cols || !Number.isFinite(room)) return;
    this.unit = clamp(room, 1 / 512, 64);
    this.left = (this.cols - this.canvas.width / this.unit) / 2;
    this.top = (this.rows - this.canvas.height / this.unit) / 2;
    this.moved();
  }

  /** Zoom to the next whole factor, or the next reciprocal of one. */
  zoom(by, x = this.canvas.width / 2, y = this.canvas.height / 2) {
    const [col, row] = [this.left + x / this.unit, this.top + y / this.unit];
    const next = (factor, up) => (up ? Math.floor(factor + 1e-6) + 1 : Math.ceil(factor - 1e-6) - 1);
    const larger = this.unit > 1 + 1e-6 || (by > 0 && this.unit > 1 - 1e-6);
    const unit = larger ? Math.max(1, next(this.unit, by > 0)) : 1 / Math.max(1, next(1 / this.unit, by < 0));
    this.unit = clamp(unit, 1 / 64, 64);
    this.left = Math.round(col - x / this.unit);
    this.top = Math.round(row - y / this.unit);
    this.fitted = false;
    this.moved();
  }

  pan(cols, rows) {
    this.left += cols;
    this.top += rows;
    this.fitted = false;
    this.moved();
  }

  /** Ask for the window, soon. */
  moved() {
    this.draw();
    clearTimeout(this.asking);
    this.asking = setTimeout(() => this.ask(), 15);
  }

  ask() {
    const { step } = this;
    const across = this.canvas.width / this.unit / step;
    const down = this.canvas.height / this.unit / step;
    const width = clamp(Math.ceil(across) + 2, 1, 4096);
    const height = clamp(Math.ceil(down) + 2, 1, Math.floor(MAX_PIXELS / width));
    const [left, top] = [Math.floor(this.left), Math.floor(this.top)];
    const { layer, tiled } = this.page;
    this.page.send({ kind: "view", layer, left, top, width, height, step, tiled });
  }

  show(message, bytes) {
    const picture = message.width && message.height ? bitmap(bytes, message.width, message.height) : null;
    this.panes[message.pane].frame = { ...message, picture };
    if (!message.pane && (message.rows !== this.rows || message.cols !== this.cols)) {
      [this.rows, this.cols] = [message.rows, message.cols];
      if (this.fitted) this.fit();
    }
    this.draw();
  }

  /** Show a second pane, or no more. */
  split(beside) {
    this.panes[1].canvas.hidden = !beside;
    this.panes[1].frame = null;
    this.draw();
  }

  draw() {
    if (this.drawing) return;
    this.drawing = requestAnimationFrame(() => {
      this.drawing = null;
      for (const pane of this.panes) if (!pane.canvas.hidden) this.paint(pane);
    });
  }

  paint({ canvas, frame, why }) {
    canvas.style.touchAction = this.page.painting.brush || !this.fitted ? "none" : "auto"; // else a finger scrolls the page
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, canvas.width, canvas.height);
    const { unit } = this;
    if (!frame && canvas !== this.canvas) {
      context.font = `${16 * (window.devicePixelRatio || 1)}px sans-serif`;
      lettered(context, "It is being computed …", 12, canvas.height / 2);
    }
    if (!frame) return;
    context.imageSmoothingEnabled = unit < 3 && Math.abs(unit - Math.round(unit)) > 1e-6;
    if (frame.picture) {
      const size = frame.step * unit;
      const [x, y] = [(frame.left - this.left) * unit, (frame.top - this.top) * unit].map(Math.round);
      context.drawImage(frame.picture, x, y, frame.width * size, frame.height * size);
    }
    for (const one of this.page.painting.visible) this.strokes(context, one);
    if (this.page.lattice && !["sample", "use"].includes(frame.layer)) this.lattice(context, this.page.lattice);
    if (why) this.mark(context, frame, why);
    const { cursor } = this;
    const { brush } = this.page.painting;
    if (cursor && brush) {
      const at = [(cursor[0] - this.left) * unit, (cursor[1] - this.top) * unit];
      const radius = Math.max(3, (brush.width * unit) / 2);
      for (const [colour, more] of [["#000", 1], ["#fff", -1]]) ring(context, ...at, radius + more, colour, 2);
      context.font = `${12 * (window.devicePixelRatio || 1)}px sans-serif`;
      lettered(context, `${brush.width} px`, at[0] + radius * 0.7 + 6, at[1] + radius * 0.7 + 12);
    }
  }

  /** Outline rows x cols pixels of the layer in black and white. */
  outline(context, left, top, cols, rows, width = 1) {
    const box = [(left - this.left) * this.unit, (top - this.top) * this.unit, cols * this.unit, rows * this.unit];
    for (const [colour, by] of [["#000", 3 * width], ["#fff", width]]) {
      [context.strokeStyle, context.lineWidth] = [colour, by];
      context.strokeRect(...box);
    }
  }

  /** Mark a pixel and its neighbourhood or, in the sample, its candidates by rank. */
  mark(context, frame, { pixel, corner, level, offsets, confidence, candidates }) {
    const size = 2 ** (level ?? 0);
    if (frame.layer === "sample" || frame.layer === "use") {
      context.font = `${12 * (window.devicePixelRatio || 1)}px sans-serif`;
      for (const { place, rank, taken } of [...(candidates ?? [])].reverse()) {
        this.outline(context, place[1], place[0], 1, 1, taken ? 3 : 1);
        lettered(context, rank, (place[1] + 1.5 - this.left) * this.unit, (place[0] + 1 - this.top) * this.unit);
      }
      return;
    }
    const [row, col] = corner ?? pixel;
    (offsets ?? []).forEach(([down, across], index) => {
      if (!down && !across) return;
      context.globalAlpha = 0.25 + 0.75 * confidence[index];
      context.strokeStyle = HOLE;
      context.lineWidth = 1;
      const at = [(col + across * size - this.left) * this.unit + 1, (row + down * size - this.top) * this.unit + 1];
      context.strokeRect(...at, size * this.unit - 2, size * this.unit - 2);
    });
    context.globalAlpha = 1;
    this.outline(context, col, row, size, size, 2);
  }

  /** Draw the lattice: lines along both of its vectors, (row, column). */
  lattice(context, { vectors }) {
    const [first, second] = vectors;
    const area = Math.abs(first[0] * second[1] - first[1] * second[0]);
    if (!area) return;
    const reach = Math.ceil((Math.hypot(this.rows, this.cols) * Math.max(Math.hypot(...first), Math.hypot(...second))) / area) + 1;
    context.save();
    context.beginPath();
    context.rect(-this.left * this.unit, -this.top * this.unit, this.cols * this.unit, this.rows * this.unit);
    context.clip();
    [context.strokeStyle, context.lineWidth] = [HOLE, 1.5];
    context.beginPath();
    for (const [along, across] of [[first, second], [second, first]]) {
      for (let n = -reach; n <= reach; n += 1) {
        for (const end of [-reach, reach]) {
          const [row, col] = [0, 1].map((axis) => n * across[axis] + end * along[axis]);
          const to = [(col - this.left) * this.unit, (row - this.top) * this.unit];
          if (end < 0) context.moveTo(...to);
          else context.lineTo(...to);
        }
      }
    }
    context.stroke();
    context.restore();
  }

  /** Draw strokes of the brush, only their outlines if they are `hollow`. */
  strokes(context, { strokes, colour, hollow }) {
    const layer = document.createElement("canvas"); // of its own, so that strokes over one another are not darker
    [layer.width, layer.height] = [this.canvas.width, this.canvas.height];
    const on = layer.getContext("2d");
    on.lineCap = on.lineJoin = "round";
    for (const stroke of strokes) {
      on.globalCompositeOperation = stroke.label === 0 ? "destination-out" : "source-over";
      on.strokeStyle = colour(stroke.label);
      on.lineWidth = Math.max(1, stroke.width * this.unit);
      on.beginPath();
      const [[x, y]] = stroke.points;
      const points = stroke.points.length > 1 ? stroke.points : [[x, y], [x + 0.01, y]]; // a line without a length is not drawn
      points.forEach(([x, y], index) => {
        const at = [(x + 0.5 - this.left) * this.unit, (y + 0.5 - this.top) * this.unit];
        if (index) on.lineTo(...at);
        else on.moveTo(...at);
      });
      on.stroke();
      if (!hollow || stroke.width * this.unit <= 4) continue;
      on.globalCompositeOperation = "destination-out";
      on.lineWidth -= 4;
      on.stroke();
    }
    context.globalAlpha = 0.6;
    context.drawImage(layer, 0, 0);
    context.globalAlpha = 1;
  }

  place(event) {
    const box = event.currentTarget.getBoundingClientRect();
    const ratio = event.currentTarget.width / box.width;
    return [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
  }

  press(event) {
    if (event.button !== 0) return;
    const { inside } = this.page;
    const { brush } = this.page.painting;
    if (event.pointerType === "touch" && !brush && this.fitted && !inside.open) return;
    let [x, y] = this.place(event);
    let dragged = 0;
    const point = () => [this.left + x / this.unit, this.top + y / this.unit].map((one) => Math.round(10 * (one - 0.5)) / 10);
    const move = (now) => {
      const [toX, toY] = this.place(now);
      if (brush) {
        [x, y] = [toX, toY];
        brush.add(point());
        this.draw();
        return;
      }
      dragged += Math.abs(toX - x) + Math.abs(toY - y);
      const [cols, rows] = [(x - toX) / this.unit, (y - toY) / this.unit].map(Math.round);
      if ((!cols && !rows) || dragged < 4) return;
      [x, y] = [x - cols * this.unit, y - rows * this.unit];
      this.pan(cols, rows);
    };
    brush?.begin(point());
    drag(event.currentTarget, event, move, () => {
      if (brush) brush.end();
      else if (dragged < 4) inside.pick(Math.floor(this.top + y / this.unit), Math.floor(this.left + x / this.unit));
    });
    this.draw();
  }

  /** Show the picture that was given, or the result 3 x 3 times, while a key is held. */
  held(key, down) {
    if (key === "t") this.page.tiled = down;
    if (key !== "b" || down === Boolean(this.before)) return;
    const layer = down ? "sample" : this.before;
    this.before = down ? this.page.layer : null;
    this.page.showLayer(layer);
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(event.deltaY < 0 ? 1 : -1, ...this.place(event));
  }

  key(event) {
    const directions = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const { inside } = this.page;
    const { brush } = this.page.painting;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in directions) {
      const [x, y] = directions[event.key];
      if (brush) {
        const by = Math.max(1, Math.round(brush.width / 4)) * (event.shiftKey ? 4 : 1);
        const [col, row] = this.cursor ?? [this.cols / 2, this.rows / 2];
        this.cursor = [clamp(col + x * by, 0, this.cols - 1), clamp(row + y * by, 0, this.rows - 1)];
        if (this.down) brush.add([...this.cursor]);
        this.draw();
      } else if (inside.pixel && !event.shiftKey) {
        inside.move(x, y);
      } else {
        const by = Math.max(1, Math.round(32 / this.unit));
        this.pan(x * by, y * by);
      }
    } else if (event.key === " " && brush) {
      this.cursor ??= [this.cols / 2, this.rows / 2];
      this.down = !this.down;
      if (this.down) brush.begin([...this.cursor]);
      else brush.end();
      this.draw();
    } else if (event.key === "+" || event.key === "=") this.zoom(1);
    else if (event.key === "-") this.zoom(-1);
    else if (event.key === "0") this.fit();
    else if (["b", "t"].includes(event.key)) this.held(event.key, true);
    else if (event.key === "Enter" && inside.open && !brush) inside.pickMiddle();
    else if (event.key === "Escape" && inside.pixel) inside.unpick();
    else return;
    event.preventDefault();
    event.stopPropagation(); // a notebook has its own meaning for keys
  }
}
