// The sheet of a row of alarms: shelve it for a time and with a reason, take it out of service, and back.
import { followLock, isLocked, markLock, sendAct } from "./alarm-line.js";
import { followRows, rowOf } from "./alarm-rows.js";
import { placeBeside } from "./beside.js";
import { closest, find, setText } from "./show.js";

const sheet = find(document, "#alarm-sheet");
const form = find(sheet, "form");
/** @type {HTMLElement | null} */
let item = null; // the row whose sheet is open
let id = ""; // of its alarm
let isBusy = false;

/** @param {PageSource} source */
export function equip(source) {
  addEventListener("click", (event) => {
    const button = closest(event.target, "button.more-acts");
    if (!button) return;
    item = button.closest("li");
    const row = item && rowOf.get(item);
    if (!row) return; // before the first event: the form opens it
    event.preventDefault();
    id = row.id;
    setText(find(sheet, ".refused"), "");
    show();
    sheet.showPopover();
    placeBeside(sheet, button.getBoundingClientRect());
    find(sheet, "button").focus();
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    act(event.submitter?.dataset.actOfRow ?? "", event, source);
  });
  followLock(show);
  followRows(show);
}

// As the alarm is now: one that is over has no acts.
function show() {
  markLock(sheet);
  const shown = item?.isConnected ? rowOf.get(item) : null;
  const row = shown?.id === id ? shown : null;
  /** @type {string[]} */
  const acts = row?.acts ?? [];
  if (row) showAlarm(row);
  for (const part of form.querySelectorAll("[data-of]"))
    part.hidden = !part.dataset.of?.split(" ").some((act) => acts.includes(act));
  for (const button of form.querySelectorAll("button[data-act-of-row]")) {
    const name = button.dataset.actOfRow ?? "";
    const isHigh = name === "shelve" && row?.priority === 1 && !acts.includes("unshelve");
    const isPossible = acts.includes(name);
    button.hidden = !isPossible && !isHigh;
    button.disabled = !isPossible || isLocked() || sheet.dataset.roleLock !== undefined;
    const why = button.querySelector("small");
    if (why) why.hidden = isPossible;
  }
}

/** @param {Data} row */
function showAlarm({ text, priority, out_of_service, shelf }) {
  const title = find(sheet, "h3");
  title.dataset.priority = priority;
  setText(find(title, "span"), text);
  const taken = out_of_service ?? shelf ?? {};
  for (const place of form.querySelectorAll("[data-taken]")) {
    const said = taken[place.dataset.taken ?? ""] ?? "";
    setText(place, said);
    if (place.parentElement) place.parentElement.hidden = said === "";
  }
}

/** @param {string} name @param {Event} event @param {PageSource} source */
async function act(name, event, source) {
  if (!name || isBusy) return;
  isBusy = true;
  sheet.setAttribute("aria-busy", "true");
  const about = id;
  /** @type {Record<string, Data>} */
  const body = { seen: source.seen ?? "", at: source.timeOf(event) };
  if (name === "shelve") body.for_s = Number(find(form, "select[name=for_s]").value);
  if (name === "shelve" || name === "out_of_service") body.reason = find(form, "select[name=reason]").value;
  const reason = await sendAct(sheet.dataset.root ?? "", `${encodeURIComponent(about)}/${name}`, body);
  isBusy = false;
  sheet.removeAttribute("aria-busy");
  if (about !== id) return;
  setText(find(sheet, ".refused"), reason);
  if (!reason && sheet.matches(":popover-open")) sheet.hidePopover();
}
