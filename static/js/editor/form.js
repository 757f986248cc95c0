// The form of the selected table, rendered by the server. A changed field posts the edits of its key. A refresh of the
// pane keeps the focus, the caret, what is being typed and a composition of an input method.
import { updateInPlace } from "../in-place.js";

/**
 * @typedef {(string | number)[]} Path
 * @typedef {{ op: string, path: Path, value?: unknown, toml?: string, to?: Path, id?: string, text?: string }} Edit
 * @typedef {{ ok: boolean, behind?: boolean, message?: string }} Posted
 * @typedef {{ view: string, kind: string, pick: string }} View
 * @typedef {object} FormHost
 * @property {(edits: Edit[], label: string) => Promise<Posted>} post
 * @property {(query: Record<string, string>) => Promise<string | null>} load the pane's HTML, by path and view
 * @property {(path: Path) => void} select
 * @property {(path: Path, file: File) => Promise<Posted>} upload
 */

const NUMBER = /^[-+]?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$/;
const TOML = /^\s*(true|false|["'[].*|\{[^=]*=.*|\{\s*\})\s*$/s; // "{speed}" is a text
const STEPPED_MS = 400; // after the last arrow key, before its number is posted
const ROW = ".field, .rows";
const CONTROLS = "input:not([type=file]), select, textarea, button:not(:disabled)";
const COMPACT = 6; // decimals of a number that arrow keys made

/** @typedef {HTMLInputElement | HTMLTextAreaElement | HTMLSelectElement} Entry */

/** @param {Element} element @param {string} name @returns {any} */
const json = (element, name) => JSON.parse(element.getAttribute(`data-${name}`) ?? "null");

/** @param {EventTarget | null} target @param {string} selector @returns {HTMLElement | null} */
const near = (target, selector) => (target instanceof Element ? target.closest(selector) : null);

/** @param {HTMLElement} row */
const nameOf = (row) => row.id || row.dataset.row;

/** @param {EventTarget | null} target @returns {target is Entry} */
function isEntry(target) {
  return (
    (target instanceof HTMLInputElement ||
      target instanceof HTMLTextAreaElement ||
      target instanceof HTMLSelectElement) &&
    target.type !== "checkbox" &&
    target.type !== "file"
  );
}

/** @param {Entry} entry the value as the server has it */
function known(entry) {
  if (!(entry instanceof HTMLSelectElement)) return entry.defaultValue;
  return [...entry.options].find((option) => option.defaultSelected)?.value ?? "";
}

// A typed number as TOML writes it; null for anything else. A decimal comma is one, and a number with decimals keeps them.
/** @param {string} typed @param {string} before */
function numberText(typed, before) {
  const text = typed
    .trim()
    .replace(/^([-+]?\d+),(\d+)$/, "$1.$2")
    .replace(/^([-+]?)\./, "$10.");
  if (!NUMBER.test(text)) return null;
  return /^[-+]?\d+\.\d+$/.test(before) && /^[-+]?\d+$/.test(text) ? `${text}.0` : text;
}

// What an edit has as its value: `value`, or `toml`, the text of a value; null where the key goes.
/** @param {string} sends @param {string} typed @param {string} before @returns {Partial<Edit> | null} */
function parsedValue(sends, typed, before) {
  if (typed.trim() === "") return null;
  const number = numberText(typed, before);
  switch (sends) {
    case "number":
      return number === null ? { value: typed } : { toml: number };
    case "numbers": {
      const parts = typed.replace(/^\s*\[|\]\s*$/g, "").split(/[,;\s]+/);
      const numbers = parts.filter(Boolean).map((part) => numberText(part, ""));
      return numbers.includes(null) ? { value: typed } : { toml: `[${numbers.join(", ")}]` };
    }
    case "literal":
      if (number !== null) return { toml: number };
      return TOML.test(typed) ? { toml: typed.trim() } : { value: typed };
    case "toml":
      return { toml: typed };
    case "list":
      return {
        value: typed
          .split("\n")
          .map((line) => line.trim())
          .filter(Boolean),
      };
    case "json":
      return { value: JSON.parse(typed) };
    default:
      return { value: typed };
  }
}

/** @param {Entry} entry @returns {Edit[]} */
function editsOf(entry) {
  const { sends = "text", around, tag } = entry.dataset;
  const typed = entry.value;
  if (entry.hasAttribute("data-by-edits")) return typed ? JSON.parse(typed) : [];
  /** @type {Path} */
  const path = json(entry, "path");
  if (sends === "key") {
    const value = json(entry, "value");
    if (!typed.trim()) return [];
    const steps = value === "" ? typed.trim().split(".") : [typed.trim()];
    return [{ op: "set", path: [...path, ...steps], value }];
  }
  if (sends === "id") {
    const id = typed.trim();
    return [known(entry) && id ? { op: "rename", path: path.slice(0, -1), id } : { op: "set", path, value: id }];
  }
  if (around !== undefined && tag) {
    return typed ? [{ op: "set", path, value: { ...JSON.parse(around), [tag]: typed } }] : [];
  }
  const made = parsedValue(sends, typed, known(entry));
  if (made) return [{ op: "set", path, ...made }, ...typeOf(entry)];
  return [entry.hasAttribute("data-required") ? { op: "set", path, value: "" } : { op: "delete", path }];
}

// The type of a chosen topic, service or action is written beside it.
/** @param {Entry} entry @returns {Edit[]} */
function typeOf(entry) {
  const list = entry instanceof HTMLInputElement && entry.dataset.typePath ? entry.list : null;
  const option = [...(list?.options ?? [])].find((each) => each.value === entry.value);
  const type = option?.dataset.type;
  return type?.includes("/") ? [{ op: "set", path: json(entry, "type-path"), value: type }] : [];
}

/** @param {HTMLElement} group @returns {Edit[]} */
function ticked(group) {
  /** @type {Path} */
  const path = json(group, "path");
  const boxes = /** @type {NodeListOf<HTMLInputElement>} */ (group.querySelectorAll("input:checked"));
  const values = [...boxes].map((box) => JSON.parse(box.value));
  if (!values.length) return [{ op: "delete", path }];
  return [{ op: "set", path, value: group.hasAttribute("data-single") && values.length === 1 ? values[0] : values }];
}

export class Form {
  /** @type {HTMLElement} */
  #pane;
  /** @type {FormHost} */
  #host;
  /** @type {Path} */
  #path = [];
  /** @type {View} */
  #view = { view: "form", kind: "", pick: "" };
  #loads = 0;
  /** @type {Promise<void>} */
  #drawing = Promise.resolve();
  /** @type {Promise<unknown>} */
  #last = Promise.resolve();
  /** @type {Set<Entry>} what was refused, and stands as it was typed */
  #refused = new Set();
  /** @type {Map<Entry, string>} what is on its way */
  #sent = new Map();
  /** @type {Map<HTMLElement, number>} lists to tick, with how many of their ticks are on their way */
  #ticking = new Map();
  /** @type {Entry | null} */
  #composing = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #stepping;

  /** @param {HTMLElement} pane @param {FormHost} host */
  constructor(pane, host) {
    this.#pane = pane;
    this.#host = host;
    pane.addEventListener("change", (event) => this.#changed(event.target));
    pane.addEventListener("click", (event) => this.#clicked(event));
    pane.addEventListener("keydown", (event) => this.#key(event));
    pane.addEventListener("submit", (event) => this.#submitted(event));
    pane.addEventListener("compositionstart", (event) => {
      this.#composing = isEntry(event.target) ? event.target : null;
    });
    pane.addEventListener("compositionend", () => {
      this.#composing = null;
    });
    for (const event of ["focusin", "pointerover"]) pane.addEventListener(event, (at) => this.#help(at.target));
  }

  /** @param {Path} path @param {string} [view] */
  show(path, view = "form") {
    if (JSON.stringify(path) !== JSON.stringify(this.#path)) this.#refused.clear();
    this.#path = path;
    this.#view = { view, kind: "", pick: "" };
    return this.refresh();
  }

  // Puts the focus into the field with this id, or into the first one in it, when the form is drawn.
  /** @param {string} id */
  async focus(id) {
    await this.#drawing;
    this.#focusIn(document.getElementById(id), `${CONTROLS}, summary`);
  }

  // Puts the focus into the field that is filled in first, when the form is drawn.
  async focusNeeded() {
    await this.#drawing;
    const id = this.#pane.querySelector("[data-needed]")?.getAttribute("data-needed") ?? "";
    const row = /** @type {HTMLElement | null} */ (this.#pane.querySelector(`[data-row="${CSS.escape(id)}"]`));
    this.#focusIn(document.getElementById(id) ?? row, `${CONTROLS}, summary`);
  }

  // Posts what is being typed, and waits until all that was posted has an answer.
  enter() {
    const entry = document.activeElement;
    if (entry !== this.#composing && this.#pane.contains(entry)) this.#changed(entry);
    return this.#last;
  }

  // The pane as the server has it now, or at a later refresh that has begun meanwhile.
  refresh() {
    this.#drawing = this.#draw();
    return this.#drawing;
  }

  /** @returns {Promise<void>} */
  async #draw() {
    const load = ++this.#loads;
    const html = await this.#host.load({ path: JSON.stringify(this.#path), ...this.#view });
    if (load !== this.#loads) return this.#drawing;
    if (html === null) return undefined;
    const fresh = document.createElement("div");
    fresh.innerHTML = html;
    for (const details of fresh.querySelectorAll("details[id]")) {
      const there = document.getElementById(details.id);
      if (there instanceof HTMLDetailsElement && this.#pane.contains(there))
        details.toggleAttribute("open", there.open);
    }
    const focused = this.#pane.contains(document.activeElement) ? document.activeElement : null;
    const rows = focused ? this.#rowsFrom(focused) : [];
    const kept = { skips: (/** @type {Element} */ node) => isEntry(node) && this.#isTyped(node), stays: isRefusal };
    updateInPlace(this.#pane, fresh, kept);
    for (const entry of this.#entries()) if (!this.#isTyped(entry)) reset(entry);
    for (const box of /** @type {NodeListOf<HTMLInputElement>} */ (this.#pane.querySelectorAll("[type=checkbox]"))) {
      const group = near(box, "[data-sends=ticks]");
      if (!group || !this.#ticking.has(group)) box.checked = box.defaultChecked;
    }
    for (const entry of this.#refused) if (!entry.isConnected) this.#refused.delete(entry);
    if (focused && document.activeElement === document.body) this.#focusAgain(focused, rows);
    return undefined;
  }

  // The names of the row that an element is in, and of those after it.
  /** @param {Element} element @returns {(string | undefined)[]} */
  #rowsFrom(element) {
    const rows = /** @type {HTMLElement[]} */ ([...this.#pane.querySelectorAll(ROW)]);
    const first = rows.findLastIndex((row) => row.contains(element));
    return first < 0 ? [] : rows.slice(first).map(nameOf);
  }

  // A field that has another place keeps the focus, and what is being typed. Where it is gone or folded, what its row
  // has now, or the next one, has the focus; without these the first.
  /** @param {Element} before @param {(string | undefined)[]} rows */
  #focusAgain(before, rows) {
    const there = before.isConnected ? before : document.getElementById(before.id);
    const same = there?.checkVisibility() ? there : null; // not folded
    const found = same ?? this.#firstOf(rows) ?? this.#pane.querySelector(`.form :is(${CONTROLS})`);
    if (same !== before && isEntry(same) && isEntry(before) && before.value !== known(before))
      same.value = before.value;
    if (found instanceof HTMLElement) found.focus({ preventScroll: same === found });
  }

  // The first control of the first of these rows that is there.
  /** @param {(string | undefined)[]} rows */
  #firstOf(rows) {
    const there = new Map();
    for (const row of /** @type {NodeListOf<HTMLElement>} */ (this.#pane.querySelectorAll(ROW)))
      there.set(nameOf(row), row.checkVisibility() ? row.querySelector(CONTROLS) : null);
    return rows.map((name) => there.get(name)).find(Boolean);
  }

  /** @returns {Entry[]} */
  #entries() {
    return [.../** @type {NodeListOf<Entry>} */ (this.#pane.querySelectorAll("input, textarea, select"))].filter(
      isEntry,
    );
  }

  // Whether an entry has what the server has not seen, or refused.
  /** @param {Entry} entry */
  #isTyped(entry) {
    if (entry === this.#composing || this.#refused.has(entry) || this.#sent.has(entry)) return true;
    return entry === document.activeElement && entry.value !== known(entry) && !(entry instanceof HTMLSelectElement);
  }

  /** @param {EventTarget | null} target */
  #changed(target) {
    clearTimeout(this.#stepping);
    const group = near(target, "[data-sends=ticks]");
    if (group) {
      this.#ticking.set(group, (this.#ticking.get(group) ?? 0) + 1);
      return this.#post(ticked(group), group);
    }
    if (target instanceof HTMLInputElement && target.dataset.upload && target.files?.[0]) {
      return this.#upload(target, target.files[0]);
    }
    if (!isEntry(target)) return undefined;
    if (target.hasAttribute("data-kinds")) return this.#look({ kind: JSON.parse(target.value || '""') });
    if (!target.dataset.sends) return undefined;
    const before = this.#sent.get(target) ?? known(target);
    if (target.value === before && !this.#refused.has(target)) return undefined;
    const edits = editsOf(target);
    return edits.length ? this.#post(edits, target) : undefined;
  }

  /** @param {HTMLInputElement} input @param {File} file */
  async #upload(input, file) {
    const posted = await this.#host.upload(json(input, "upload"), file);
    input.value = "";
    if (posted.ok) forgive(input);
    else refuse(input, posted.message ?? "");
    return this.refresh();
  }

  #title() {
    return this.#pane.querySelector("[data-form]")?.getAttribute("data-title");
  }

  // Edits are posted one after the other; the pane is busy until the last of them is drawn. What is refused stands as
  // it was typed, with the reason.
  /** @param {Edit[]} edits @param {HTMLElement} at */
  #post(edits, at) {
    const sent = isEntry(at) ? at.value : "";
    const label = near(at, "[data-label]")?.dataset.label ?? "";
    if (isEntry(at)) this.#sent.set(at, sent);
    const posting = this.#last.then(async () => {
      const title = this.#title();
      let posted = await this.#host.post(edits, label);
      if (posted.behind) {
        await this.refresh(); // another browser was faster: again, if the same table is there
        if (this.#title() === title) posted = await this.#host.post(edits, label);
      }
      if (isEntry(at)) {
        if (posted.ok) this.#refused.delete(at);
        else this.#refused.add(at);
      }
      const ticks = (this.#ticking.get(at) ?? 1) - 1;
      if (ticks) this.#ticking.set(at, ticks);
      else this.#ticking.delete(at);
      if (posted.ok) forgive(at);
      else refuse(at, posted.message ?? "");
      if (posted.ok && isEntry(at) && at.value === sent && !at.hasAttribute("data-by-edits")) settle(at);
      if (isEntry(at) && this.#sent.get(at) === sent) this.#sent.delete(at);
      await this.refresh();
      return posted.ok;
    });
    this.#pane.setAttribute("aria-busy", "true");
    const last = posting
      .catch(() => undefined)
      .then(() => {
        if (this.#last === last) this.#pane.removeAttribute("aria-busy");
      });
    this.#last = last;
    return posting;
  }

  /** @param {MouseEvent} event */
  async #clicked(event) {
    const button = near(event.target, "button");
    if (!button) return;
    const { edits, view, open, pick, kind, then, done } = button.dataset;
    if (edits) {
      const list = near(button, ".rows, .opened, .message, section, .form");
      if (!(await this.#post(JSON.parse(edits), button))) return;
      if (done !== undefined) await this.#look({ kind: "" });
      if (open !== undefined) this.#host.select(JSON.parse(open));
      else this.#focusAfter(then, list, /^\[{"op": "(insert|set)"/.test(edits));
    } else if (pick !== undefined) await this.#look({ pick: this.#view.pick === pick ? "" : pick });
    else if (kind !== undefined) await this.#look({ kind });
    else if (open !== undefined) {
      /** @type {Path} */
      const path = JSON.parse(open);
      if (view && `${path}` === `${this.#path}`) await this.show(path, view);
      else this.#host.select(path);
    } else if (view) await this.show(this.#path, view);
  }

  // The focus after a button went with its row, or made a table: there.
  /** @param {string | undefined} then @param {HTMLElement | null} list @param {boolean} isNew */
  #focusAfter(then, list, isNew) {
    const made = then ? document.getElementById(then) : null;
    if (made) {
      this.#focusIn(made, isNew ? "input, select, textarea" : "summary");
    } else if (document.activeElement === document.body) {
      /** @type {HTMLElement | null} */ (list?.querySelector("button:not(:disabled), input, summary"))?.focus();
    }
  }

  // Opens what is folded around an element, and focuses it, or its first control.
  /** @param {HTMLElement | null} element @param {string} controls */
  #focusIn(element, controls) {
    if (!element || !this.#pane.contains(element)) return;
    for (let around = /** @type {Element | null} */ (element); around; around = around.parentElement) {
      if (around instanceof HTMLDetailsElement) around.open = true;
    }
    const control = element.matches(controls) ? element : element.querySelector(controls);
    /** @type {HTMLElement | null} */ (control)?.focus();
    element.scrollIntoView({ block: "nearest" }); // the help below has its height now
  }

  /** @param {Partial<View>} change */
  #look(change) {
    Object.assign(this.#view, change);
    return this.refresh();
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const { target } = event;
    if (event.isComposing) return;
    if (near(target, "[role=tablist]")) this.#walk(event);
    if (!isEntry(target)) return;
    if (event.key === "Escape" && (target.value !== known(target) || this.#refused.has(target))) {
      this.#refused.delete(target);
      reset(target);
      forgive(target);
      event.stopPropagation();
    } else if (event.key === "Enter" && this.#refused.has(target) && target instanceof HTMLInputElement) {
      this.#changed(target);
    } else if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
      if (target.form?.matches(".as-text")) target.form.requestSubmit();
      else this.#changed(target);
    } else if (target.dataset.step && (event.key === "ArrowUp" || event.key === "ArrowDown")) {
      event.preventDefault();
      this.#step(/** @type {HTMLInputElement} */ (target), event.key === "ArrowUp" ? 1 : -1);
    }
  }

  // One step of a number, within its limits, posted when the arrows rest.
  /** @param {HTMLInputElement} input @param {number} sign */
  #step(input, sign) {
    const { low = "", high = "" } = input.dataset;
    const number = numberText(input.value || input.placeholder || "0", "");
    if (number === null) return;
    const stepped = Number(number) + sign * Number(input.dataset.step);
    const least = low === "" ? -Infinity : Number(low);
    const most = high === "" ? Infinity : Number(high);
    const text = `${Number(Math.min(most, Math.max(least, stepped)).toFixed(COMPACT))}`;
    input.value = /\.\d/.test(input.value || input.placeholder) && !text.includes(".") ? `${text}.0` : text;
    clearTimeout(this.#stepping);
    this.#stepping = setTimeout(() => this.#changed(input), STEPPED_MS);
  }

  // Arrow keys from tab to tab.
  /** @param {KeyboardEvent} event */
  #walk(event) {
    const tabs = /** @type {HTMLElement[]} */ ([...(near(event.target, "[role=tablist]")?.children ?? [])]);
    const at = tabs.indexOf(/** @type {HTMLElement} */ (event.target));
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to === undefined || at < 0) return;
    event.preventDefault();
    tabs[(to + tabs.length) % tabs.length]?.focus();
  }

  /** @param {SubmitEvent} event */
  #submitted(event) {
    const form = /** @type {HTMLFormElement} */ (event.target);
    if (!form.matches(".as-text")) return;
    event.preventDefault();
    const area = /** @type {HTMLTextAreaElement} */ (form.elements.namedItem("text"));
    void this.#post([{ op: "text", path: json(form, "text-of"), text: area.value }], area);
  }

  /** @param {EventTarget | null} target */
  #help(target) {
    const strip = this.#pane.querySelector(".form-help");
    const field = near(target, ".beside, .field") ?? near(document.activeElement, ".beside, .field");
    const help = field && [...field.querySelectorAll("[data-help]")].at(-1);
    if (strip instanceof HTMLElement) strip.textContent = help?.textContent ?? strip.dataset.usual ?? "";
  }
}

/** @param {Entry} entry */
function reset(entry) {
  if (entry instanceof HTMLSelectElement) {
    const chosen = [...entry.options].findIndex((option) => option.defaultSelected);
    entry.selectedIndex = Math.max(chosen, 0);
  } else if (entry.value !== entry.defaultValue) entry.value = entry.defaultValue;
}

// What was posted is what the server has: the next refresh may change it.
/** @param {Entry} entry */
function settle(entry) {
  if (entry instanceof HTMLSelectElement) {
    for (const option of entry.options) option.defaultSelected = option.selected;
  } else if (entry.dataset.sends === "key") entry.value = entry.defaultValue;
  else entry.defaultValue = entry.value;
}

// The server's reason at a field: it stays until the field is right.
/** @param {HTMLElement} at @param {string} message */
function refuse(at, message) {
  const field = near(at, ".field, .as-text, .rows") ?? at;
  forgive(at);
  const why = document.createElement("p");
  why.className = "why refused";
  why.setAttribute("role", "alert");
  why.textContent = message;
  field.append(why);
  if (isEntry(at)) at.setAttribute("aria-invalid", "true");
}

/** @param {HTMLElement} at */
function forgive(at) {
  near(at, ".field, .as-text, .rows")?.querySelector(":scope > .refused")?.remove();
  if (isEntry(at)) at.removeAttribute("aria-invalid");
}

/** @param {Element} element */
function isRefusal(element) {
  return element.matches(".refused");
}
