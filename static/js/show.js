// Shows the attributes and receipts of widgets: texts and element properties, in place. Composes no sentence.
import { releaseEntry } from "./entries.js";
import { showOutcome } from "./receipts.js";

// What the scripts of widget kinds register, by the kind.
/** @type {Map<string | undefined, Hooks>} */
const registered = new Map();

/** @param {string} kind @param {Hooks} hooks */
export function addHooks(kind, hooks) {
  registered.set(kind, hooks);
}

/** @param {HTMLElement} root @returns {Hooks} */
export function hooksOf(root) {
  return registered.get(root.dataset.kind) ?? {};
}

// Whether the script of its kind is there, if there is one: nothing is pressed before that.
/** @param {HTMLElement} root */
export function isEquipped({ dataset: { kind = "" } }) {
  return registered.has(kind) || !pageGuard.page.kinds.includes(kind);
}

// Whether a person confirms its presses with a PIN.
/** @param {HTMLElement} root */
export const needsPerson = (root) => pageGuard.page.confirms.includes(root.dataset.widget ?? "");

// An element that the markup must have.
/** @template {string} S @param {ParentNode} root @param {S} selector @returns {PageElement<S>} */
export function find(root, selector) {
  const element = root.querySelector(selector);
  if (!element) throw new Error(selector);
  return element;
}

// The element that an event met, or one around it.
/** @template {string} S @param {EventTarget | null} target @param {S} selector @returns {PageElement<S> | null} */
export function closest(target, selector) {
  return target instanceof Element ? target.closest(selector) : null;
}

/** @param {HTMLTemplateElement} template */
export function copyOf(template) {
  return find(document.importNode(template.content, true), "*");
}

/** @param {HTMLElement | null} element @param {string | undefined} text */
export function setText(element, text = "") {
  if (!element) return;
  if (element.dataset.unit) setValue(element, text);
  else setOnlyText(element, text);
}

// A number and, smaller, its unit; another text, such as that there is no value, has none.
/** @param {HTMLElement} element @param {string} text */
function setValue(element, text) {
  const [number, unit] = find(element, "span").children;
  const ending = ` ${element.dataset.unit}`;
  const hasUnit = text.endsWith(ending);
  setOnlyText(number, hasUnit ? text.slice(0, -ending.length) : text);
  setOnlyText(unit, hasUnit ? ending : "");
}

// A text node that is there stays: a new one would cost the page its style and layout as well.
/** @param {Element} element @param {string} text */
function setOnlyText(element, text) {
  const node = element.firstChild;
  if (node instanceof Text && !node.nextSibling) {
    if (node.data !== text) node.data = text;
  } else if (node || text) element.textContent = text;
}

// What is locked with a widget: its buttons. It can always be canceled, and a button of its kind's script (`data-own`) has a lock of its own. Looked for once:
// a permission that changes does not wait for it.
/** @type {WeakMap<HTMLElement, HTMLButtonElement[]>} */
const keys = new WeakMap();

/** @param {HTMLElement} root @returns {HTMLButtonElement[]} */
function keysOf(root) {
  const selector = "button[type=submit]:not(.cancel):not([data-own]), button.hold";
  const buttons = keys.get(root) ?? [...root.querySelectorAll(selector)];
  keys.set(root, buttons);
  return buttons;
}

/** @template T @param {T | null} element @param {Partial<T>} properties */
const assign = (element, properties) => element && Object.assign(element, properties);

// How an attribute is shown. One that is not here has a place in the markup: `data-text` for a text,
// `data-value` for the value of an element such as a meter, `data-width` for the width of a bar in percent, or an
// attribute of the widget's root.
/** @type {Record<string, Show>} */
const SHOW = {
  enabled: (root, value) => {
    for (const key of keysOf(root)) key.disabled = !value;
    hooksOf(root).lock?.(root, !value);
    if (!value) root.querySelector(".ask:popover-open")?.hidePopover();
  },
  stoppable: (root, value) => assign(root.querySelector("button.cancel"), { disabled: !value }),
  press: (root, value) => assign(root.querySelector("button.cancel"), { value }),
  held: (root, value) => root.toggleAttribute("data-held", value),
  outcome: (root, outcome) => assign(find(root, ".result").dataset, { outcome }),
  aged: (root, value) => find(root, ".result").toggleAttribute("data-aged", value),
  busy: (root, value) => {
    root.toggleAttribute("data-busy", value);
    assign(root.querySelector("progress"), { hidden: !value });
  },
  progress: (root, value) => {
    const bar = root.querySelector("progress");
    if (value === null) bar?.removeAttribute("value");
    else if (bar) bar.value = value;
  },
};

// What the server says of attributes of which the page itself decides for now (hold-locks.js), by the widget.
/** @type {Map<HTMLElement, Attributes>} */
export const withheld = new Map();

/** @param {HTMLElement} root @param {Attributes} attributes */
export function showAttributes(root, attributes) {
  for (const [name, value] of Object.entries(attributes)) showAttribute(root, name, value);
}

/** @param {HTMLElement} root @param {string} name @param {Data} value */
function showAttribute(root, name, value) {
  const fromServer = withheld.get(root);
  if (fromServer && name in fromServer) {
    fromServer[name] = value;
    return;
  }
  const show = hooksOf(root).show?.[name] ?? SHOW[name];
  if (show) show(root, value);
  else showInPlace(root, name, value);
}

/** @param {HTMLElement} root @param {string} name @param {Data} value */
function showInPlace(root, name, value) {
  setText(root.querySelector(`[data-text="${name}"]`), value ?? "");
  const meter = /** @type {HTMLMeterElement | null} */ (root.querySelector(`[data-value="${name}"]`));
  if (meter) meter.value = value ?? meter.min;
  root.querySelector(`[data-width="${name}"]`)?.setAttribute("width", `${value ?? 0}%`);
  if (root.hasAttribute(`data-${name}`)) root.setAttribute(`data-${name}`, value ?? "");
}

// What fails in one widget shows there, and leaves the others as they are.
/** @param {HTMLElement} root @param {() => void} work */
export function attempt(root, work) {
  if ("failed" in root.dataset) return;
  try {
    work();
  } catch (error) {
    root.dataset.failed = "";
    showFailed(root, pageGuard.page.sentences.broken);
    console.error(`widget "${root.dataset.widget}" can not be shown`, error);
  }
}

// Locks a widget that can't be shown, for good: what it shows is no longer updated.
/** @param {HTMLElement} root @param {string} text */
function showFailed(root, text) {
  for (const button of root.querySelectorAll("button")) button.disabled = true;
  if (root.dataset.state) root.dataset.state = "unreadable";
  for (const name of ["reason", "note"]) setText(root.querySelector(`[data-text="${name}"]`), text);
}

// Without a connection no permission is known and each value is old. Its note keeps the time of the value.
/** @param {HTMLElement} root @param {string} lost @param {string} unknown */
export function lockWidget(root, lost, unknown) {
  if (root.querySelector(".cancel:enabled")) setText(root.querySelector('[data-text="doing"]'), unknown);
  const buttons = root.querySelectorAll("button[type=submit], button.hold");
  for (const button of buttons) button.disabled = true;
  root.querySelector(".ask:popover-open")?.hidePopover();
  const reason = root.querySelector(".why")?.dataset.lost ?? lost; // of a stop button: what to use instead
  if (buttons.length) showAttributes(root, { reason, reasons: reason, more: "", enabled: false });
  // The tile of a robot.
  if ("link_state" in root.dataset) {
    showAttributes(root, { link_state: "wait", link: unknown, since: "", alarm: unknown, priority: "" });
  }
  if (!root.dataset.state) return;
  root.dataset.state = "old";
  if (!root.dataset.shape) return;
  Object.assign(root.dataset, { shape: "old", colour: "none" });
  setText(root.querySelector('[data-text="text"]'), unknown);
}

// Shows the receipt of a press at its widget, and none at the others.
/** @param {Iterable<HTMLElement>} widgets @param {HTMLElement} root @param {Receipt} receipt */
export function showReceipt(widgets, root, { id, outcome, reason }) {
  if (outcome === "succeeded") releaseEntry(root);
  for (const widget of widgets) {
    const old = widget.querySelector(".receipt");
    if (old) showOutcome(old, "", "");
  }
  // The result of a call is an attribute of the widget, shown in every browser. The receipt of a cancel has
  // no id: the goal's state shows that the cancel was requested.
  const shared = id ? outcome !== "refused" : outcome === "accepted";
  if (root.querySelector(".result") && shared) return;
  showOutcome(find(root, ".receipt"), outcome, reason);
}
