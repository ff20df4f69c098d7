"use strict";
// What is folded on the screen is open on paper.
addEventListener("beforeprint", () => {
  for (const d of document.querySelectorAll("details:not([open])")) { d.dataset.folded = ""; d.open = true; }
});
addEventListener("afterprint", () => {
  for (const d of document.querySelectorAll("details[data-folded]")) { delete d.dataset.folded; d.open = false; }
});
