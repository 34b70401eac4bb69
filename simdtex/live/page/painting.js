// SPDX-License-Identifier: BSD-3-Clause

// -- painting -----------------------------------------------------------------------------------------------------

const NO_STROKES = { sample: [], output: [], hole: [] };

/** The strokes of the brush: labels on the sample and on the output, and a hole; and the tools, which lie on the view. */
class Painting {
  constructor(page) {
    this.page = page;
    this.undone = [];
    observe(this, { strokes: NO_STROKES, past: [], label: 1, width: 16 }); // label 0 erases
  }

  /** Whose strokes the brush adds to. */
  get surface() {
    const { task, seen } = this.page;
    return task === "hole" ? "hole" : task === "classes" || seen === "sample" ? "sample" : "output";
  }

  /** Whether the layer that is shown can be painted on; the run itself cannot. */
  get possible() {
    const { task, place, seen, watching } = this.page;
    if (place !== "paint") return false;
    if (task === "classes") return PICTURE_LAYERS.includes(seen); // which stays as it is during the run
    return !watching && ["sample", "picture"].includes(seen);
  }

  get brush() {
    if (!this.possible) return null;
    const { width, surface } = this;
    const label = surface === "hole" ? Math.min(this.label, 1) : this.label;
    return {
      width,
      begin: (point) => this.change({ ...this.strokes, [surface]: [...this.strokes[surface], { label, width, points: [point] }] }),
      add: (point) => this.strokes[surface].at(-1)?.points.push(point),
      end: () => this.changed(),
    };
  }

  /** Paint; what was there before can be had back. */
  change(strokes) {
    this.past = [...this.past, this.strokes];
    this.undone = [];
    this.strokes = strokes;
  }

  undo() {
    if (!this.past.length) return;
    this.undone.push(this.strokes);
    this.strokes = this.past.at(-1);
    this.past = this.past.slice(0, -1);
    this.changed();
  }

  redo() {
    if (!this.undone.length) return;
    this.past = [...this.past, this.strokes];
    this.strokes = this.undone.pop();
    this.changed();
  }

  clear() {
    this.change({ ...this.strokes, ...(this.page.task === "hole" ? { hole: [] } : { sample: [], output: [] }) });
    this.changed();
  }

  /** Begin with the strokes of a result, or with none. */
  restore({ guide, hole } = {}) {
    this.past = [];
    this.undone = [];
    this.strokes = structuredClone({ ...NO_STROKES, ...guide, hole: hole ?? [] });
  }

  /** Run again with labels that have changed. */
  changed() {
    const { sample, output } = this.strokes;
    if (this.page.task === "classes" || (this.page.task === "guide" && sample.length && output.length)) this.page.changed();
  }

  /** What the view draws: strokes over their own result are hollow, since they would hide it. */
  get visible() {
    const { results, shown, colours, seen } = this.page;
    if (!this.possible) return [];
    const { guide, hole } = results.get(shown)?.settings ?? {};
    const hollow = seen === "picture" && Boolean(guide || hole);
    return [{ strokes: this.strokes[this.surface], colour: this.surface === "hole" ? () => HOLE : (label) => colours[label], hollow }];
  }

  /** The tools. */
  tools() {
    const { page } = this;
    const pressed = (label) => ({ "aria-pressed": () => `${this.label === label || (page.task === "hole" && label === 1 && this.label > 0)}` });
    const choose = (label) => () => (this.label = label);
    const colours = () => (page.task === "hole" ? ["Brush"] : page.colours.slice(1).map((_, index) => `Label ${index + 1}`));
    const swatch = (name, index) => {
      const found = button("", choose(index + 1), { ...pressed(index + 1), "aria-label": name, title: name, class: "colour" });
      found.style.background = page.task === "hole" ? HOLE : page.colours[index + 1];
      return found;
    };
    const side = (layer, text) => button(text, () => page.showLayer(layer), { "aria-pressed": () => `${page.layer === layer}` });
    const on = make("div", { class: "bar", role: "group", "aria-label": "Paint on", hidden: () => page.task === "classes" }, side("sample", "On the sample"), side("picture", "On the result"));
    const task = choice(page.tasks("paint"), () => page.setTask(task.value), { value: () => page.task });
    return make(
      "div",
      { class: "tools", role: "toolbar", "aria-label": "Brush", hidden: () => page.place !== "paint" },
      labelled("Paint", task),
      on,
      make("div", { class: "bar", role: "group", "aria-label": "Labels" }, () => colours().map(swatch)),
      button("Eraser", choose(0), pressed(0)),
      labelled("Brush width", number({ min: 1, max: 1024, value: () => this.width, onchange: ({ target }) => (this.width = clamp(Math.round(Number(target.value)) || 16, 1, 1024)) })),
      button("Undo", () => this.undo(), { disabled: () => !this.past.length, title: "Ctrl+Z" }),
      button("Redo", () => this.redo(), { title: "Ctrl+Shift+Z" }),
      button("Clear", () => this.clear()),
    );
  }

  /** Undo and redo by their keys, unless a field has its own text to undo. */
  key(event) {
    if (this.page.place !== "paint" || !(event.ctrlKey || event.metaKey) || event.target.matches("input[type=number]")) return;
    const act = { z: () => (event.shiftKey ? this.redo() : this.undo()), y: () => this.redo() }[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }
}
