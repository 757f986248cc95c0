// The lines of alarms, below the header and on pages, and the acts on alarms that all parts of the page share.
import { newId, post, TAP_AGAIN_MS } from "./press.js";
import { closest, find, setText } from "./show.js";

// Acts on alarms: their requests, and why all of them are locked.

const RESPONSE_TIMEOUT_MS = 5000;
const TO_CONFIRM = ["confirm_needed_pin", "confirm_needed_two"];
const IN_CONTROL = ["", "holding", "asked"];

// What locks every act, as the line of the frame has it.
const frame = find(document, "form.alarm-line").dataset;
const state = { lock: frame.lock ?? "", isCut: frame.cut !== undefined };
/** @type {Set<() => void>} */
const followers = new Set();

// Calls back at once, and when the lock has changed.
/** @param {() => void} show */
export function followLock(show) {
  followers.add(show);
  show();
}

// The lock of a client without the role stays: a sign-in loads the page again.
/** @param {string} role */
export function setControl(role) {
  if (frame.noRole === undefined) setLock({ lock: IN_CONTROL.includes(role) ? "" : "control" });
}

/** @param {Partial<typeof state>} changed */
export function setLock(changed) {
  Object.assign(state, changed);
  for (const show of followers) show();
}

export function isLocked() {
  return state.lock !== "" || state.isCut;
}

// Marks a part of the page with the reason, which its style sheet shows.
/** @param {HTMLElement} root */
export function markLock(root) {
  root.dataset.lock = state.lock;
  if (state.isCut) root.dataset.cut = "";
  else delete root.dataset.cut;
}

// Sends an act and returns what its receipt says, "" for nothing. A second tap is the same act: it must not meet another
// alarm that comes to the same place.
/** @param {string} root @param {string} path @param {Record<string, Data>} body @returns {Promise<string>} */
export async function sendAct(root, path, body) {
  const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
  const address = `${root}/alarms/${path}`;
  const answer = await send(address, { ...body, id: newId() });
  if (TO_CONFIRM.includes(answer.code)) askPerson(`${address}/confirm`, body);
  await pause;
  return answer.error ?? answer.reason ?? "";
}

// To the page on which a person confirms the act.
/** @param {string} address @param {Record<string, Data>} body */
function askPerson(address, body) {
  const carried = ["occurrence", "reason", "for_s"]
    .filter((name) => body[name])
    .map((name) => [name, String(body[name])]);
  const query = new URLSearchParams([...carried, ["id", newId()], ["page", location.pathname + location.search]]);
  location.assign(`${address}?${query}`);
}

/** @param {string} address @param {object} body @returns {Promise<Data>} */
async function send(address, body) {
  try {
    return await (await post(address, body, RESPONSE_TIMEOUT_MS)).json();
  } catch {
    return { reason: pageGuard.page.sentences.unsure };
  }
}

// The line of alarms below the header, and those on pages: the newest unacknowledged alarm of the highest priority, and
// its Acknowledge.

const TEXTS = ["priority_text", "since_text", "text", "action"];

export class LineView {
  #line;
  #button;
  #occurrence;
  #source;
  /** @type {{ id: string, occurrence: number, seen: string | null } | null} */
  #touched = null; // the alarm that the line showed when the finger went down on an enabled button
  #refusedFor = "";
  /** @type {Record<string, string>} */
  #robots; // their names by their ids, where there are several
  #busy = false;

  /** @param {HTMLElement} line @param {PageSource} source */
  constructor(line, source) {
    this.#line = line;
    this.#button = find(line, "button[type=submit]");
    this.#occurrence = line.querySelector("input[name=occurrence]") ?? this.#button;
    this.#source = source;
    this.#robots = JSON.parse(find(line, ".robot").dataset.names ?? "{}");
    addEventListener("pointerdown", ({ target }) => this.#down(target), true);
    this.#button.addEventListener("click", (event) => {
      event.preventDefault();
      this.#acknowledge(event);
    });
    followLock(() => this.#lock());
  }

  /** @param {Data} alarms */
  show(alarms) {
    const row = alarms.line;
    const { dataset } = this.#line;
    dataset.alarm = row?.id ?? "";
    dataset.priority = row?.priority ?? "";
    dataset.known = row?.known ?? true;
    dataset.standing = alarms.standing;
    this.#occurrence.value = row?.occurrence ?? "";
    for (const name of TEXTS) setText(this.#text(name), row?.[name] ?? "");
    setText(find(this.#line, ".robot"), this.#robots[row?.robot] ?? "");
    const steps = (row?.action ?? "").trim().split("\n").length;
    setText(find(this.#line, ".step-of"), steps > 1 ? `1/${steps}` : "");
    setText(this.#text("unacknowledged"), String(alarms.unacknowledged));
    setText(this.#text("active"), String(alarms.active));
    this.#ask(alarms.asked);
    if (this.#refusedFor !== this.#shown) setText(find(this.#line, ".refused"), "");
    this.#lock();
  }

  // The question why the machine stood still, while there is no alarm: the line of the frame has it.
  /** @param {Data | null | undefined} asked */
  #ask(asked) {
    const text = this.#line.querySelector(".asked");
    if (!(text instanceof HTMLElement)) return;
    text.hidden = find(this.#line, ".asked-key").hidden = !asked;
    for (const name of ["text", "times"]) setText(find(text, `[data-text="${name}"]`), asked?.[name] ?? "");
  }

  #lock() {
    markLock(this.#line);
    if (isLocked()) this.#touched = null;
    this.#button.disabled = !this.#line.dataset.alarm || isLocked();
  }

  /** @param {string} name */
  #text(name) {
    return find(this.#line, `[data-text="${name}"]`);
  }

  get #shown() {
    return `${this.#line.dataset.alarm} ${this.#occurrence.value}`;
  }

  // The alarm that is shown now.
  #alarm() {
    const occurrence = Number(this.#occurrence.value);
    return { id: this.#line.dataset.alarm ?? "", occurrence, seen: this.#source.seen };
  }

  /** @param {EventTarget | null} target */
  #down(target) {
    this.#touched = closest(target, "button:enabled") === this.#button ? this.#alarm() : null;
  }

  // Acknowledges what was shown at the touch.
  /** @param {MouseEvent} event */
  async #acknowledge(event) {
    const alarm = event.detail > 0 ? this.#touched : this.#alarm();
    if (!alarm || this.#busy) return;
    this.#busy = true;
    this.#line.setAttribute("aria-busy", "true");
    const { id, occurrence, seen } = alarm;
    const body = { occurrence, seen: seen ?? "", at: this.#source.timeOf(event) };
    const reason = await sendAct(this.#line.dataset.root ?? "", `${encodeURIComponent(id)}/acknowledge`, body);
    this.#refusedFor = this.#shown;
    setText(find(this.#line, ".refused"), reason);
    this.#busy = false;
    this.#line.removeAttribute("aria-busy");
  }
}

// The line of the frame: it also says to the rest of the page what is locked.
export class AlarmLine {
  #line = find(document, "form.alarm-line");
  #view;
  #isSnapshot = true; // the next section is whole: the first of a stream
  /** @type {(alarms: Data, isSnapshot: boolean) => void} */
  showRows = () => {}; // of a page without the list
  #source;
  /** @type {{ update(alarms: Data, server: string): void, lost(): void } | null} */
  sound = null; // of a panel without sound

  /** @param {PageSource} source */
  constructor(source) {
    this.#source = source;
    this.#view = new LineView(this.#line, source);
    this.#line.addEventListener("submit", (event) => event.preventDefault());
  }

  /** @param {Data} alarms */
  show(alarms) {
    setLock({ isCut: false });
    this.#view.show(alarms);
    const badge = document.querySelector(".pages .badge");
    if (badge) badge.dataset.priority = this.#line.dataset.priority;
    this.showRows(alarms, this.#isSnapshot);
    this.#isSnapshot = false;
    this.sound?.update(alarms, (this.#source.seen ?? "").split("-")[0]);
  }

  /** @param {string} role */
  control(role) {
    setControl(role);
  }

  lost() {
    this.#isSnapshot = true;
    setLock({ isCut: true });
    this.sound?.lost();
  }
}
