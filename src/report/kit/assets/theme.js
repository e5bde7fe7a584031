// Sets the theme of the reader's system. The button of the page changes it.
document.documentElement.dataset.theme =
  matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
