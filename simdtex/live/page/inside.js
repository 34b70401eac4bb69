// SPDX-License-Identifier: BSD-3-Clause

// -- a look inside a run ------------------------------------------------------------------------------------------

const TILE = 66; // pixels to a side of the picture of a neighbourhood, about
const FRAMES = 12; // of a sweep while the time line plays, at most
const PACE = 70; // milliseconds between two of them, at least
const HOW = "Click a pixel of the result, or press Enter in the view and move with the arrow keys.";
const NAMES = {
  distance: "distance (12)",
  coherence: "coherence",
  use: "cost of use",
  guide: "guide",
  lattice: "lattice",
  data: "data",
  soft: "soft data",
  novelty: "novelty",
  total: "total",
}; // of the terms of a cost

/** The time line of a run, and why the chosen pixel has its value. */
class Inside {
  constructor(page) {
    this.page = page;
    this.sweeps = [];
    this.at = null; // [sweep, sets], null for the result
    this.goal = null; // the moment that was asked for last, as `at`
    this.waiting = this.late = false; // whether a moment is on its way, and whether the goal is another one
    this.pixel = null; // [row, column]
    this.beside = null; // the number of the result that is shown beside the selected one
    const range = (label, onchange) => make("input", { type: "range", min: 0, max: 0, value: 0, step: 1, "aria-label": label, oninput: onchange });
    this.sweepRange = range("Sweep", () => this.seek(Number(this.sweepRange.value), null));
    this.setRange = range("Set of sites", () => this.seek(this.at[0], Number(this.setRange.value)));
    this.moment = make("output", { class: "moment" });
    this.playing = button("Play", () => this.play());
    this.choice = choice([], () => this.look(Number(this.choice.value) || null));
    this.reasons = [0, 1].map(() => make("div", { class: "reason" }));
    const step = (text, label, by) => button(text, () => this.step(by), { "aria-label": label });
    const sweepStep = (text, label, by) => button(text, () => this.stepSweep(by), { "aria-label": label });
    this.body = make(
      "div",
      { hidden: true },
      bar(
        sweepStep("«", "A sweep back", -1),
        step("‹", "A set of sites back", -1),
        this.playing,
        step("›", "A set of sites on", 1),
        sweepStep("»", "A sweep on", 1),
        labelled("Beside it", this.choice),
        button("Save this view", () => this.page.saveView(), { class: "save" }),
      ),
      make("div", { class: "lines" }, make("span", {}, "Sweep"), this.sweepRange, make("span", {}, "Set"), this.setRange),
      this.moment,
      make("div", { class: "reasons" }, ...this.reasons),
    );
    this.status = make("p", { role: "status" });
    this.element = make(
      "details",
      { class: "inside", ontoggle: () => this.toggled() },
      make("summary", {}, "Look inside: see why each pixel has its value"),
      this.status,
      this.body,
    );
  }

  get open() {
    return this.element.open && !this.body.hidden;
  }

  toggled() {
    if (this.element.open) this.look(this.beside);
    else {
      this.close();
      this.page.offerLayers();
    }
  }

  /** Ask for the run of the selected result, and of the one beside it. */
  look(beside = null) {
    if (!this.element.open) return;
    this.status.textContent = this.page.shown === null ? "Look inside when there is a result." : "The run is repeated …";
    this.beside = beside;
    this.page.view.split(beside !== null);
    if (this.page.shown !== null) this.page.send({ kind: "inside", open: true, beside });
  }

  /** Close the time line. */
  close() {
    this.stop();
    if (!this.body.hidden) this.page.send({ kind: "inside", open: false });
    this.body.hidden = true;
    this.at = this.goal = this.beside = null;
    this.waiting = this.late = false;
    this.unpick();
    this.page.view.split(false);
    if (this.page.layer === "sets") this.page.showLayer("picture");
  }

  /** Show why there is nothing to look into. */
  failed(text) {
    this.waiting = false;
    if (!this.page.view.panes[1].frame) this.page.view.split(false);
    if (this.element.open && this.body.hidden) this.status.textContent = text;
  }

  on_inside({ panes }, buffers) {
    this.panes = panes;
    this.samples = panes.map(({ preview }, n) => bitmap(buffers[n], ...preview));
    [this.sweeps, this.body.hidden] = [panes[0].sweeps, false];
    this.status.textContent = "";
    this.beside = panes[1]?.result ?? null;
    this.page.view.split(panes.length > 1);
    const others = [...this.page.results.values()].filter(({ result, layers }) => result !== panes[0].result && layers.includes("temperature"));
    this.choice.replaceChildren(...choices([["", "Nothing"], ...others.map(({ result }) => [`${result}`, `Result ${result}`])]));
    this.choice.value = this.beside ?? "";
    this.sweepRange.max = this.sweeps.length;
    const [at] = panes.map(({ moment }) => moment);
    this.goal = at;
    this.show(at);
    if (panes.length > 1 && at) this.seek(...at);
    if (this.pixel) this.explain();
    else this.hint();
  }

  // -- the time line

  /** Go to a moment: so many sets of a sweep, null for all; the sweep after the last is the result. */
  seek(sweep, sets) {
    const number = clamp(sweep, 0, this.sweeps.length);
    this.goal = number < this.sweeps.length ? [number, sets ?? this.sweeps[number][2]] : null;
    if (this.waiting) this.late = true;
    else this.ask();
  }

  /** Ask for the goal. */
  ask() {
    [this.waiting, this.late] = [true, false];
    const [number, sets] = this.goal ?? [];
    const [level, sweep] = this.goal ? this.sweeps[number] : [];
    this.page.send(this.goal ? { kind: "seek", level, sweep, sets } : { kind: "seek" });
  }

  on_moments({ moments }) {
    this.waiting = false;
    if (!this.late) [this.goal] = moments;
    this.show(moments[0]);
    if (this.late) this.ask();
    else if (this.pixel) this.explain();
  }

  /** Show where on the time line the view is. */
  show(moment) {
    this.at = moment;
    const [number, sets] = moment ?? [this.sweeps.length, 0];
    this.sweepRange.value = number;
    this.setRange.disabled = !moment;
    this.setRange.max = moment ? this.sweeps[number][2] : 0;
    this.setRange.value = sets;
    this.moment.textContent = moment ? this.describe(number, sets) : "The result.";
    this.sweepRange.setAttribute("aria-valuetext", this.moment.textContent);
    this.page.offerLayers();
  }

  describe(number, sets) {
    const [level, sweep, all, sites, temperature] = this.sweeps[number];
    const last = this.sweeps.filter(([other]) => other === level).length;
    const state = temperature > 0 ? `mean temperature ${temperature.toFixed(3)}` : "free: all temperatures are 0";
    return `Level ${level}, sweep ${sweep} of ${last}, set ${sets} of ${all}, ${sites} sites in the sweep, ${state}.`;
  }

  step(by) {
    const [sweep, sets] = this.goal ?? [this.sweeps.length, 0];
    if (this.page.layer === "picture") this.page.showLayer("sets");
    if (sets + by > (this.sweeps[sweep]?.[2] ?? 0)) this.seek(sweep + 1, Math.min(by, this.sweeps[sweep + 1]?.[2] ?? 0));
    else if (sets + by < 0) this.seek(sweep - 1, sweep ? null : 0);
    else this.seek(sweep, sets + by);
  }

  stepSweep(by) {
    this.seek((this.goal?.[0] ?? this.sweeps.length) + by, null);
  }

  play() {
    if (this.timer) {
      this.stop();
      return;
    }
    this.playing.textContent = "Stop";
    let [sweep, sets] = this.at ?? [0, 0];
    const next = () => {
      if (sweep >= this.sweeps.length) {
        this.stop();
        return;
      }
      const all = this.sweeps[sweep][2];
      if (sets >= all) [sweep, sets] = [sweep + 1, 0];
      else sets = Math.min(all, sets + Math.max(1, Math.ceil(all / FRAMES)));
      if (!this.waiting) this.seek(sweep, sets);
      this.timer = setTimeout(next, PACE);
    };
    next();
  }

  stop() {
    clearTimeout(this.timer);
    this.timer = null;
    this.playing.textContent = "Play";
  }

  // -- why

  hint() {
    this.reasons[0].replaceChildren(make("p", {}, HOW));
    this.reasons[1].replaceChildren();
  }

  pick(row, col) {
    if (!this.open) return;
    const { rows, cols } = this.page.view.panes[0].frame ?? {};
    if (["sample", "use"].includes(this.page.seen) || !rows) return;
    const wrap = (n, side) => (this.page.tiled ? ((n % side) + side) % side : n);
    this.pixel = [clamp(wrap(row, rows), 0, rows - 1), clamp(wrap(col, cols), 0, cols - 1)];
    this.explain();
  }

  pickMiddle() {
    this.pick(this.page.view.rows >> 1, this.page.view.cols >> 1);
  }

  move(across, down) {
    const { rows, cols } = this.page.view;
    const [row, col] = this.pixel;
    const size = 2 ** (this.at ? this.sweeps[this.at[0]][0] : 0);
    this.pixel = [(row + down * size + rows) % rows, (col + across * size + cols) % cols];
    this.explain();
  }

  unpick() {
    this.pixel = null;
    for (const pane of this.page.view.panes) pane.why = null;
    this.page.view.draw();
    this.hint();
  }

  explain() {
    this.page.send({ kind: "explain", row: this.pixel[0], col: this.pixel[1] });
  }

  on_explained(why) {
    if (!this.pixel) return;
    this.page.view.panes[why.pane].why = why;
    this.page.view.draw();
    const place = this.reasons[why.pane];
    const title = this.beside === null ? "" : `Result ${this.panes[why.pane].result}, `;
    const text = `${title}pixel (row ${why.pixel[0]}, column ${why.pixel[1]}). ${sentence(why.reason.replace(/\.$/, ""))}`;
    const heading = make("p", {}, text[0].toUpperCase() + text.slice(1));
    if (!why.candidates) {
      place.replaceChildren(heading);
      return;
    }
    const cooled = `Temperature ${why.temperature.toFixed(3)}, after the relaxation ${why.cooled.toFixed(3)}. Bandwidth h = ${why.bandwidth.toFixed(2)} grey levels.`;
    const white = why.pixels.map((pixel, n) => pixel.map((one) => one * why.confidence[n] + 255 * (1 - why.confidence[n])));
    const around = make(
      "figure",
      {},
      this.tile(why.offsets, white, null, 2 * TILE),
      make("figcaption", {}, "Its neighbourhood; white: confidence 1 − t is 0."),
    );
    place.replaceChildren(heading, make("p", {}, cooled), bar(around, this.marks(why)), this.table(why), ...this.density(why));
  }

  /** A neighbourhood as a picture: pixels at offsets, and one in the middle. */
  tile(offsets, pixels, middle, about = TILE) {
    const radius = Math.max(...offsets.flat().map(Math.abs));
    const size = Math.max(3, Math.round(about / (2 * radius + 1)));
    const side = (2 * radius + 1) * size;
    const canvas = make("canvas", { width: side, height: side, class: "tile", "aria-hidden": "true" });
    const context = canvas.getContext("2d");
    const cell = (row, col, pixel) => {
      const [red, green, blue] = pixel.length < 3 ? [pixel[0], pixel[0], pixel[0]] : pixel;
      context.fillStyle = `rgb(${red} ${green} ${blue})`;
      context.fillRect((col + radius) * size, (row + radius) * size, size, size);
    };
    offsets.forEach(([row, col], n) => cell(row, col, pixels[n]));
    if (middle) cell(0, 0, middle);
    context.strokeStyle = HOLE;
    context.strokeRect(radius * size + 0.5, radius * size + 0.5, size - 1, size - 1);
    return canvas;
  }

  /** The sample with the candidates, the first by rank the brightest. */
  marks({ candidates, pane }) {
    const { width, height } = this.panes[pane];
    const small = this.samples[pane];
    const size = 220 / Math.max(width, height);
    const canvas = make("canvas", { width: width * size, height: height * size, "aria-hidden": "true" });
    const context = canvas.getContext("2d");
    context.imageSmoothingEnabled = canvas.width < small.width;
    context.drawImage(small, 0, 0, canvas.width, canvas.height);
    for (const { place, rank, taken } of [...candidates].reverse()) {
      const [x, y] = [(place[1] + 0.5) * size, (place[0] + 0.5) * size];
      for (const [colour, wide] of [["#000", 3], [taken ? HOLE : "#fff", 1.5]]) ring(context, x, y, taken ? 7 : 5, colour, wide);
      context.font = "bold 11px sans-serif";
      lettered(context, rank, x + 7, y - 3);
    }
    return make("figure", {}, canvas, make("figcaption", {}, "Candidates in the sample, by rank; the ring in colour is taken."));
  }

  table({ candidates, offsets, pane }) {
    const terms = Object.keys(candidates[0].costs);
    const heads = ["around", "probability", "rank", "row, column", "continues", ...terms.map((name) => NAMES[name] ?? name)];
    const cells = (one) => {
      const share = make("span", { class: "share" });
      share.style.width = `${100 * one.probability}%`;
      const costs = terms.map((name) => one.costs[name].toFixed(1));
      const texts = [`${one.rank}${one.taken ? ", taken" : ""}`, one.place.join(", "), one.continues, ...costs];
      const [middle, ...around] = one.pixels;
      const tile = make("td", {}, this.tile(offsets, around, middle));
      const chance = make("td", { class: "bars" }, make("span", {}, one.probability.toPrecision(3)), share);
      return make("tr", { class: one.taken ? "taken" : null }, tile, chance, ...texts.map((text) => make("td", {}, `${text}`)));
    };
    return make(
      "div",
      { class: "wide", tabindex: 0, role: "region", "aria-label": `Candidates of result ${this.panes[pane].result}` },
      make("table", {}, make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text)))), make("tbody", {}, ...candidates.map(cells))),
    );
  }

  /** The LCPDF over grey levels, a bar chart for each channel. */
  density({ density, values }) {
    return (density?.bars ?? []).map((bars, channel) => {
      const [width, height] = [4 * bars.length, 80];
      const canvas = make("canvas", { width, height, role: "img", "aria-label": `LCPDF of channel ${channel}; drawn: ${values[channel]}` });
      const context = canvas.getContext("2d");
      const most = Math.max(...bars);
      bars.forEach((one, n) => {
        const drawn = density.starts[n] <= values[channel] && !(density.starts[n + 1] <= values[channel]);
        context.fillStyle = drawn ? HOLE : "#7d8a8c";
        context.fillRect(4 * n, height - (height * one) / most, 3, (height * one) / most);
      });
      return make("figure", {}, canvas, make("figcaption", {}, `LCPDF of channel ${channel} over grey levels; the coloured bar has the level drawn, ${values[channel]}.`));
    });
  }
}

// -- the tour -----------------------------------------------------------------------------------------------------

const TOUR = [
  [".result", "A texture from a sample", "Every pixel of this picture was drawn by what the sample says about its neighbours. Coarse levels come first: they settle the large shapes."],
  [".lines", "The time line", "Each mark is a sweep, coarsest level first. Drag it, or press Play, and watch the picture settle. The layer Temperature shows what is still uncertain."],
  [".panes", "Sites that relax together", "› goes on by one set. The coloured sites relax at the same time: no two of them are neighbours, so each still follows the equations. Another schedule has other sets."],
  [".panes", "Why this pixel", "The outlines are the pixel's neighbourhood, strong where the neighbours are certain. simdtex compares it with every candidate of the sample."],
  [".reasons", "The choice", "Each line is a candidate: how far its neighbourhood is from the pixel's, equation (12), what is added, and its probability, the LCPDF. One of them is taken. Put another result beside this one to compare two settings."],
]; // what is pointed at, a title, and a text

/** Five steps for first-time visitors. */
class Tour {
  constructor(page) {
    this.page = page;
    this.title = make("h2", { id: "simdtex-tour" });
    this.text = make("p");
    this.forth = button("Next", () => this.go(this.number + 1), { class: "next" });
    this.back = button("Back", () => this.go(this.number - 1));
    const buttons = bar(this.back, this.forth, button("Close", () => this.close()));
    this.element = make("section", { class: "tour", role: "dialog", "aria-labelledby": "simdtex-tour", hidden: true, tabindex: -1 }, this.title, this.text, buttons);
    this.element.addEventListener("keydown", (event) => event.key === "Escape" && this.close());
  }

  /** Begin, with an example if there is no result; an error of a run or of a look inside ends it. */
  async start(opener) {
    const { page } = this;
    this.opener = opener;
    const done = (kind) => Promise.race([page.next(kind), page.next("error")]);
    if (!page.results.size) {
      if (!page.picture) page.give({ name: "brick", maps: new Map() });
      else if (!page.running) page.make();
      await done("result");
      if (!page.results.size) return;
    }
    if (page.shown === null) page.send({ kind: "select", result: Math.max(...page.results.keys()) });
    if (!page.inside.open) {
      if (page.inside.element.open) page.inside.look();
      else page.inside.element.open = true;
      await done("inside");
      if (!page.inside.open) return;
    }
    this.element.hidden = false;
    this.go(0);
    this.element.focus();
  }

  go(number) {
    const { inside } = this.page;
    if (number >= TOUR.length) {
      this.close();
      return;
    }
    this.number = number;
    const [place, title, text] = TOUR[number];
    this.title.textContent = `${number + 1} of ${TOUR.length}: ${title}`;
    this.text.textContent = text;
    this.back.disabled = number === 0;
    this.forth.textContent = number === TOUR.length - 1 ? "End" : "Next";
    this.point(place);
    const finest = inside.sweeps.findIndex(([level]) => level === 0);
    if (number === 1) inside.seek(Math.max(0, finest - 1), null);
    if (number === 2) {
      this.page.showLayer("sets");
      inside.seek(Math.max(0, finest), 1);
    }
    if (number === 3) {
      this.page.showLayer("picture");
      inside.seek(inside.sweeps.length - 1, null);
      inside.pickMiddle();
    }
  }

  point(place) {
    this.page.root.querySelector(".pointed")?.classList.remove("pointed");
    const found = place && this.page.root.querySelector(place);
    found?.classList.add("pointed");
    found?.scrollIntoView({ block: "nearest" });
  }

  close() {
    this.element.hidden = true;
    this.point(null);
    this.opener.focus();
  }
}
