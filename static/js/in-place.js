// Puts what was fetched into the page that is there: texts and attributes, in place. An element is not replaced under
// a finger.

/** @typedef {{ skips?: (element: Element) => boolean, stays?: (element: Element) => boolean }} Kept */

// The children of an element become those of another: rows are found by their data-row, others by their place. What
// `kept` skips is left as it is, what stays is not removed.
/** @param {Element} old @param {Element} fresh @param {Kept} [kept] */
export function updateInPlace(old, fresh, kept = {}) {
  const rows = new Map([...old.children].map((child) => [keyOf(child), child]));
  const places = telling(old).filter((node) => !keyOf(node));
  /** @type {ChildNode | null} */
  let place = tellingFrom(old.firstChild);
  const done = new Set();
  for (const wanted of telling(fresh)) {
    const key = keyOf(wanted);
    const present = key ? rows.get(key) : places.shift();
    const node = present && present.nodeName === wanted.nodeName ? present : document.importNode(wanted, true);
    if (node === present) updateNode(node, wanted, kept);
    if (node !== place) old.insertBefore(node, place);
    done.add(node);
    place = tellingFrom(node.nextSibling);
  }
  for (const node of telling(old)) {
    if (!done.has(node) && !(node instanceof Element && kept.stays?.(node))) node.remove();
  }
}

/** @param {Node} node @param {Node} wanted @param {Kept} kept */
function updateNode(node, wanted, kept) {
  if (node instanceof Element && wanted instanceof Element) {
    if (kept.skips?.(node)) return;
    updateAttributes(node, wanted);
    updateInPlace(node, wanted, kept);
  } else if (node.nodeValue !== wanted.nodeValue) node.nodeValue = wanted.nodeValue;
}

// The children without the white space between elements.
/** @param {Element} parent @returns {ChildNode[]} */
function telling(parent) {
  return [...parent.childNodes].filter(isTelling);
}

/** @param {ChildNode | null} node @returns {ChildNode | null} */
function tellingFrom(node) {
  return node && !isTelling(node) ? tellingFrom(node.nextSibling) : node;
}

/** @param {Node} node */
function isTelling(node) {
  return node instanceof Element || Boolean(node.nodeValue?.trim());
}

/** @param {Node} node */
function keyOf(node) {
  return node instanceof Element ? (node.getAttribute("data-row") ?? "") : "";
}

/** @param {Element} old @param {Element} fresh */
function updateAttributes(old, fresh) {
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  for (const { name } of [...old.attributes]) if (!fresh.hasAttribute(name)) old.removeAttribute(name);
}
