// SPDX-License-Identifier: BSD-3-Clause

// -- elements -----------------------------------------------------------------------------------------------------

let count = 0;

/** An element with attributes, listeners (`onclick`) and children. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else if (value !== undefined && value !== null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
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
const choice = (pairs, onchange) => make("select", { onchange }, ...choices(pairs));
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

/** The controls of a method, made from the options' declarations. */
class Options {
  constructor(controls, onchange) {
    this.controls = controls;
    this.fields = new Map();
    const groups = new Map();
    for (const control of controls) {
      if (!groups.has(control.group)) {
        groups.set(control.group, make("details", {}, make("summary", {}, control.group)));
      }
      groups.get(control.group).append(this.field(control, onchange));
    }
    this.element = make("div", {}, ...groups.values());
  }

  field(control, onchange) {
    const { name, label, hint } = control;
    if (control.kind === "words" || control.kind === "switch") {
      const input = control.kind === "words" ? choice(control.valid, onchange) : checkbox({ onchange });
      const property = control.kind === "words" ? "value" : "checked";
      this.fields.set(name, { get: () => input[property], set: (value) => (input[property] = value ?? false) });
      this.fields.get(name).set(control.default);
      return labelled(label, input, hint);
    }
    const [least, most, step] = control.span;
    const input = number({ step: "any", min: control.least, placeholder: control.empty || null, onchange });
    const usual = control.usual ?? least;
    const mark = make("datalist", { id: `simdtex-${++count}` }, make("option", { value: usual }));
    const attributes = { type: "range", min: least, max: most, step, list: mark.id, title: "Double-click for the default" };
    const slider = make("input", { ...attributes, "aria-label": `${label}, slider` });
    const note = make("small", { class: "beyond", role: "status" });
    const follow = () => {
      slider.value = input.value === "" ? usual : input.value;
      slider.classList.toggle("automatic", input.value === "");
      const beyond = Number(input.value) > most;
      note.textContent = beyond ? `More than ${most}: a run can take many times as long, or need too much memory.` : "";
    };
    slider.addEventListener("input", () => {
      input.value = slider.value;
      follow();
    });
    slider.addEventListener("change", onchange);
    slider.addEventListener("dblclick", () => {
      set(control.default);
      onchange();
    });
    input.addEventListener("input", follow);
    const get = () => (input.value === "" ? null : Number(input.value));
    const set = (value) => {
      input.value = value ?? "";
      follow();
    };
    this.fields.set(name, { get, set });
    set(control.default);
    const field = labelled(label, input, hint);
    input.after(slider, mark, note);
    return field;
  }

  /** The options that differ from their defaults. */
  get values() {
    const values = this.controls.map(({ name, default: usual }) => [name, this.fields.get(name).get() ?? usual, usual]);
    return Object.fromEntries(values.filter(([, value, usual]) => value !== usual));
  }

  set values(given) {
    for (const control of this.controls) this.fields.get(control.name).set(given[control.name] ?? control.default);
  }
}
