// SPDX-License-Identifier: BSD-3-Clause

// -- elements -----------------------------------------------------------------------------------------------------

let count = 0;

/** Make fields of an object signals: an effect that reads one runs again after it is set. */
function observe(object, fields) {
  for (const [name, first] of Object.entries(fields)) {
    const held = signal(first);
    Object.defineProperty(object, name, { get: () => held.value, set: (value) => (held.value = value), configurable: true });
  }
}

/** Set an attribute, which null removes and a boolean toggles, or the state of a control. */
function assign(element, name, value) {
  if (name === "style") element.style.cssText = value;
  else if (["value", "checked"].includes(name) && value !== null) element[name] = value;
  else if (typeof value === "boolean") element.toggleAttribute(name, value);
  else if (value === undefined || value === null) element.removeAttribute(name);
  else element.setAttribute(name, value);
}

/** An element with attributes, listeners (`onclick`) and children. A function in place of a value or of all children is an effect. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  const [first] = children;
  if (typeof first === "function") effect(() => element.replaceChildren(...[first()].flat().filter((child) => child !== null)));
  else element.append(...children.filter((child) => child !== null && child !== undefined));
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (typeof value === "function") effect(() => assign(element, name, value()));
    else assign(element, name, value);
  }
  // JupyterLab asks the element with the focus alone whether keys are its own
  if (CONTROLS.includes(tag) || "tabindex" in attributes) element.dataset.lmSuppressShortcuts = "true";
  return element;
}

/** A control and its label. */
function labelled(text, control, hint = "") {
  control.id ||= `simdtex-${++count}`;
  const field = make("div", { class: "field" }, make("label", { for: control.id }, text), control);
  if (hint) {
    field.append(make("small", { id: `${control.id}-hint` }, hint));
    control.setAttribute("aria-describedby", `${control.id}-hint`);
  }
  return field;
}

const button = (text, onclick, attributes = {}) => make("button", { type: "button", onclick, ...attributes }, text);
const number = (attributes) => make("input", { type: "number", step: 1, ...attributes });
const checkbox = (attributes) => make("input", { type: "checkbox", ...attributes });
const bar = (...children) => make("div", { class: "bar" }, ...children);
const choices = (pairs) => pairs.map(([value, text]) => make("option", { value }, text));
const choice = (pairs, onchange, attributes = {}) => make("select", { onchange, ...attributes }, ...choices(pairs));
const made = (layers) => layers.find((name) => name !== "sample") ?? "sample";
const stem = (name) => name.replace(/\.[^.]*$/, "").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 40); // as simdtex names a map
const sentence = (text) => `${text[0].toUpperCase()}${text.slice(1)}.`;
const clamp = (value, least, most) => Math.max(least, Math.min(most, value));

/** RGBA bytes as something that a canvas draws. */
function bitmap(bytes, width, height) {
  const canvas = make("canvas", { width, height, "aria-hidden": "true" });
  const data = new ImageData(new Uint8ClampedArray(bytes.buffer, bytes.byteOffset, 4 * width * height), width, height);
  canvas.getContext("2d").putImageData(data, 0, 0);
  return canvas;
}

/** Draw a circle. */
function ring(context, x, y, radius, colour, width) {
  [context.strokeStyle, context.lineWidth] = [colour, width];
  context.beginPath();
  context.arc(x, y, radius, 0, 7);
  context.stroke();
}

/** Draw a text in white with a black rim. */
function lettered(context, text, x, y) {
  [context.lineWidth, context.strokeStyle, context.fillStyle] = [3, "#000", "#fff"];
  context.strokeText(`${text}`, x, y);
  context.fillText(`${text}`, x, y);
}

/** Follow a pointer that is pressed until it is released. */
function drag(element, event, move, end) {
  element.setPointerCapture(event.pointerId);
  const following = new AbortController();
  const stop = () => {
    following.abort();
    end();
  };
  const { signal } = following;
  element.addEventListener("pointermove", move, { signal });
  for (const kind of ["pointerup", "pointercancel"]) element.addEventListener(kind, stop, { signal });
}

// -- options ------------------------------------------------------------------------------------------------------

const FIRST = ["order", "structure", "balance", "finish", "light", "alpha", "iterations", "coupling", "weight", "unknown"];

/** The controls of a method, made from the options' declarations: those of the first need, and all others by group. */
class Options {
  constructor(controls, onchange) {
    this.controls = controls;
    this.onchange = onchange;
    observe(this, { values: {} }); // the options that differ from their defaults
    const groups = Map.groupBy(controls.filter(({ name }) => !FIRST.includes(name)), ({ group }) => group);
    const fields = (shown) => shown.map((control) => this.field(control));
    this.first = make("div", {}, ...fields(FIRST.flatMap((name) => controls.filter((one) => one.name === name))));
    const others = [...groups].map(([group, shown]) => make("fieldset", {}, make("legend", {}, group), ...fields(shown)));
    this.others = make("div", {}, ...others);
  }

  field(control) {
    const { name, label, hint, kind, valid, span } = control;
    const value = () => this.values[name] ?? control.default;
    const set = (given) => {
      const { [name]: before, ...others } = this.values;
      this.values = given === null || given === control.default ? others : { ...others, [name]: given };
      this.onchange();
    };
    if (kind === "words") return labelled(label, choice(valid, ({ target }) => set(target.value), { value }), hint);
    if (kind === "switch") return labelled(label, checkbox({ onchange: ({ target }) => set(target.checked), checked: value }), hint);
    const [least, most, step] = span;
    const usual = control.usual ?? least;
    const onchange = ({ target }) => {
      set(target.value === "" ? null : Number(target.value));
      target.value = value() ?? ""; // also if that is as before
    };
    const input = number({ step: "any", min: control.least, placeholder: control.empty || null, onchange, value: () => value() ?? "" });
    const mark = make("datalist", { id: `simdtex-${++count}` }, make("option", { value: usual }));
    const slider = make("input", {
      ...{ type: "range", min: least, max: most, step, list: mark.id, title: "Double-click for the default", "aria-label": `${label}, slider` },
      ...{ value: () => value() ?? usual, class: () => (value() === null ? "automatic" : null) },
      ...{ onchange: () => set(Number(slider.value)), oninput: () => (input.value = slider.value), ondblclick: () => set(null) },
    });
    const beyond = () => (value() > most ? `More than ${most}: a run can take many times as long, or need too much memory.` : "");
    const field = labelled(label, input, hint);
    input.after(slider, mark, make("small", { class: "beyond", role: "status" }, beyond));
    return field;
  }
}
