// Draws a page again where it differs: what its scripts have drawn stays in the parts that are the same.

// The live page becomes `after`; `before` is the markup that it was made from.
/** @param {Document} live @param {Document} before @param {Document} after */
export function redraw(live, before, after) {
  addSheets(live, after);
  updateAttributes(live.documentElement, before.documentElement, after.documentElement);
  redrawElement(live.body, before.body, after.body);
  equipKeys(live);
}

/** @param {Element} live @param {Element} before @param {Element} after */
function redrawElement(live, before, after) {
  if (before.isEqualNode(after)) return;
  const isAlike =
    live.localName === after.localName &&
    before.localName === after.localName &&
    live.children.length === before.children.length &&
    before.children.length === after.children.length &&
    before.children.length > 0 &&
    ownText(before) === ownText(after);
  if (!isAlike && live.localName !== "body") {
    live.replaceWith(live.ownerDocument.importNode(after, true));
    return;
  }
  updateAttributes(live, before, after);
  if (!isAlike) {
    live.replaceChildren(...live.ownerDocument.importNode(after, true).childNodes);
    return;
  }
  const children = [...live.children];
  for (const [number, child] of children.entries()) {
    redrawElement(child, before.children[number], after.children[number]);
  }
}

// The scripts of the page find in each key what they have put there (static/js/show.js): the frame that comes next has
// it from its own.
/** @param {Document} live */
function equipKeys(live) {
  for (const key of live.querySelectorAll('.key, [data-kind="step"], [data-kind="switch"]')) {
    if (key.querySelector(".more")) continue;
    const more = live.createElement("button");
    more.type = "button";
    more.className = "more";
    more.hidden = true;
    key.append(more);
  }
}

/** @param {Element} element */
function ownText(element) {
  return [...element.childNodes]
    .map((node) => (node.nodeType === Node.TEXT_NODE ? node.nodeValue?.trim() : "\n"))
    .join("");
}

/** @param {Element} live @param {Element} before @param {Element} after */
function updateAttributes(live, before, after) {
  for (const { name, value } of after.attributes) {
    if (before.getAttribute(name) !== value) live.setAttribute(name, value);
  }
  for (const { name } of [...before.attributes]) if (!after.hasAttribute(name)) live.removeAttribute(name);
}

// Styles that the page has not yet; what it has stays until the page is loaded again.
/** @param {Document} live @param {Document} after */
function addSheets(live, after) {
  for (const sheet of after.head.querySelectorAll('link[rel="stylesheet"]')) {
    const href = sheet.getAttribute("href") ?? "";
    if (!live.head.querySelector(`link[href="${CSS.escape(href)}"]`)) live.head.append(live.importNode(sheet, true));
  }
}
