// Print, on a page for paper. Without scripts the browser's own menu prints it.
import { find } from "./show.js";

const button = find(document, "button#print");
button.hidden = false;
button.addEventListener("click", () => print());
