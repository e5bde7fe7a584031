// Line breaks of the text: none between a number and its unit, and in a command only at its spaces.

const HARD = "\u00a0";
/** A number, a space, and a unit after which no letter or digit follows. */
const UNIT = /(\d|°) (?=(?:%|°\/s²?|°|m\/s²?|N m|[µm]?s|k?m|N|Hz|kg|dB)(?![\w°/²³]))/g;
const unbroken = (text) => text.replace(UNIT, `$1${HARD}`).replace(/± (?=\d)/g, `±${HARD}`).replace(/N m\b/g, `N${HARD}m`);

for (const texts = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT); texts.nextNode();) {
  const node = texts.currentNode;
  if (/\d|±/.test(node.data) && !node.parentElement.closest("code, script, style")) node.data = unbroken(node.data);
}
for (const code of document.querySelectorAll(".verdict code")) {
  const word = (text) => {
    const span = document.createElement("span");
    span.className = "word";
    span.textContent = text;
    return span;
  };
  code.replaceChildren(...code.textContent.split(" ").flatMap((text, k) => (k ? [" ", word(text)] : [word(text)])));
}
