// A list of alarms on a page. The button of a row is its most urgent act.
import { followLock, isLocked, markLock, sendAct } from "../alarm-line.js";
import { showList } from "../alarm-rows.js";
import { closest, find, setText } from "../show.js";

/** @type {WeakMap<HTMLElement, AlarmList>} */
const lists = new WeakMap();

// Called for each widget of this kind.
/** @param {HTMLElement} root @param {PageSource} source */
export const equip = (root, source) => lists.set(root, new AlarmList(root, source));

/** @type {Record<string, Show>} */
export const show = { alarms: (root, alarms) => lists.get(root)?.show(alarms) };

class AlarmList {
  #root;
  #list;
  #source;
  /** @type {{ path: string, occurrence: number, seen: string | null } | null} */
  #touched = null; // the act under the finger when it went down
  #busy = false;
  /** @type {Data} */
  #texts = { more: "", below: [] };

  /** @param {HTMLElement} root @param {PageSource} source */
  constructor(root, source) {
    this.#root = root;
    this.#list = find(root, "ol.alarms");
    this.#source = source;
    addEventListener("pointerdown", ({ target }) => this.#down(target), true);
    root.addEventListener("click", (event) => this.#act(event));
    followLock(() => this.#lock());
    this.#list.addEventListener("scroll", () => this.#showRest());
    new ResizeObserver(() => this.#showRest()).observe(this.#list);
  }

  /** @param {Data} alarms */
  show({ rows, more, below }) {
    showList(this.#list, find(this.#root, "template"), rows, (item, row) => {
      item.dataset.first = row.first;
      const button = find(item, "button.row-act");
      button.formAction = `${this.#root.dataset.root}/alarms/${encodeURIComponent(row.id)}/${row.act}`;
      button.value = row.occurrence;
      button.dataset.path = `${encodeURIComponent(row.id)}/${row.act}`;
      button.hidden = row.act === "";
      setText(button, row.act_text);
    });
    this.#texts = { more, below };
    this.#showRest();
    this.#lock();
  }

  // How many rows are below the list's edge, or are not listed. A row of which half is seen counts as seen.
  #showRest() {
    const edge = this.#list.getBoundingClientRect().bottom;
    const boxes = [...this.#list.children].map((item) => item.getBoundingClientRect());
    const hidden = boxes.filter(({ top, bottom }) => (top + bottom) / 2 > edge).length;
    const { more, below } = this.#texts;
    setText(find(this.#root, ".rest"), hidden ? (below[hidden - 1] ?? "") : more);
  }

  #lock() {
    markLock(this.#root);
    if (isLocked()) this.#touched = null;
    for (const button of this.#list.querySelectorAll("button.row-act")) button.disabled = isLocked();
    for (const button of this.#list.querySelectorAll("button.more-acts")) button.disabled = false;
  }

  /** @param {HTMLElement} button */
  #actOf(button) {
    const { path = "" } = button.dataset;
    return { path, occurrence: Number(/** @type {HTMLButtonElement} */ (button).value), seen: this.#source.seen };
  }

  /** @param {EventTarget | null} target */
  #down(target) {
    const button = closest(target, "button.row-act:enabled");
    this.#touched = button && this.#list.contains(button) ? this.#actOf(button) : null;
  }

  // Acts on what was shown at the touch: rows may move under the finger.
  /** @param {MouseEvent} event */
  async #act(event) {
    const button = closest(event.target, "button.row-act");
    if (!button) return;
    event.preventDefault();
    const act = event.detail > 0 ? this.#touched : this.#actOf(button);
    if (!act?.path || this.#busy) return;
    this.#busy = true;
    this.#root.setAttribute("aria-busy", "true");
    const { path, occurrence, seen } = act;
    const body = { occurrence, seen: seen ?? "", at: this.#source.timeOf(event) };
    const reason = await sendAct(this.#root.dataset.root ?? "", path, body);
    setText(find(this.#root, ".refused"), reason);
    this.#busy = false;
    this.#root.removeAttribute("aria-busy");
  }
}
