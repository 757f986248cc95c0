// The receipts of this page's presses: each looks old after some seconds, and goes; the operator's log keeps it. As
// the server does it with the results that all browsers show (app/view/result_age.py).
const AGED_MS = 10_000;
const GOOD_MS = 60_000;
const BAD_MS = 600_000;
const GOOD = ["published", "confirmed", "accepted", "succeeded"];

/** @type {WeakMap<HTMLElement, number>} */
const timers = new WeakMap();

// An empty outcome is none.
/** @param {HTMLElement} receipt @param {string} outcome @param {string | undefined} reason */
export function showOutcome(receipt, outcome, reason) {
  clearTimeout(timers.get(receipt));
  receipt.toggleAttribute("data-aged", false);
  receipt.textContent = reason ?? "";
  if (outcome) receipt.dataset.outcome = outcome;
  else delete receipt.dataset.outcome;
  if (reason) age(receipt, outcome);
}

/** @param {HTMLElement} receipt @param {string} outcome */
function age(receipt, outcome) {
  const left = (GOOD.includes(outcome) ? GOOD_MS : BAD_MS) - AGED_MS;
  const turnOld = () => {
    receipt.toggleAttribute("data-aged", true);
    timers.set(
      receipt,
      setTimeout(() => showOutcome(receipt, "", ""), left),
    );
  };
  timers.set(receipt, setTimeout(turnOld, AGED_MS));
}

// The one that the page came with.
for (const receipt of document.querySelectorAll(".receipt[data-outcome]"))
  if (receipt.textContent) age(receipt, receipt.dataset.outcome ?? "");
