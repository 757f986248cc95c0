// Why a button is locked and what to do, as the server has it now: a part of a page.
const TIMEOUT_MS = 1500;

// Null where it can't be got, or where the server does not lock the button.
/** @param {string | undefined} widget @returns {Promise<HTMLElement | null>} */
export async function lockHelp(widget) {
  const request = new AbortController();
  const timer = setTimeout(() => request.abort(), TIMEOUT_MS);
  try {
    if (pageGuard.isBroken || "cut" in document.body.dataset) return null;
    const { base, embed } = pageGuard.page;
    const response = await fetch(`${base}/widgets/${widget}/lock${embed}`, {
      cache: "no-store",
      signal: request.signal,
    });
    if (response.status !== 200) return null;
    const part = new DOMParser().parseFromString(await response.text(), "text/html").querySelector("div");
    return part && document.importNode(part, true);
  } catch {
    return null;
  } finally {
    clearTimeout(timer);
  }
}
