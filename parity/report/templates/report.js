"use strict";
// Everything on the page can be read without this: it sorts, filters, and plays what is in view.

const body = document.querySelector("tbody");
const headings = [...document.querySelectorAll("thead tr:last-child th")];
const filter = document.getElementById("filter");

function sortKey(row, column) {
  const cell = row.cells[column];
  const text = cell.dataset.sort ?? cell.textContent;
  return text === "" || Number.isNaN(Number(text)) ? text : Number(text);
}

function sortBy(column) {
  const heading = headings[column];
  const sign = heading.ariaSort === "ascending" ? -1 : 1;
  headings.forEach((other) => other.removeAttribute("aria-sort"));
  heading.setAttribute("aria-sort", sign === 1 ? "ascending" : "descending");
  const rows = [...body.rows].sort((a, b) => {
    const [x, y] = [sortKey(a, column), sortKey(b, column)];
    if (typeof x !== typeof y) return typeof x === "number" ? -1 : 1;
    return sign * (x < y ? -1 : x > y ? 1 : 0);
  });
  body.append(...rows);
}

headings.forEach((heading, column) => {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = heading.textContent;
  button.addEventListener("click", () => sortBy(column));
  heading.replaceChildren(button);
});

filter.closest("[hidden]").hidden = false;
filter.addEventListener("input", () => {
  const words = filter.value.trim().toLowerCase();
  let shown = 0;
  for (const row of body.rows) {
    row.hidden = !row.textContent.toLowerCase().includes(words);
    shown += !row.hidden;
  }
  document.getElementById("filtered").textContent = words ? `${shown} of ${body.rows.length}` : "";
});

// Some browsers play no video from a data: address; a blob: address serves there.
function fromBlob(video) {
  const bytes = Uint8Array.from(atob(video.src.split(",", 2)[1]), (c) => c.charCodeAt(0));
  video.src = URL.createObjectURL(new Blob([bytes], { type: "video/mp4" }));
}

const still = matchMedia("(prefers-reduced-motion: reduce)");
const paused = new WeakSet(); // by the reader, not by scrolling

const inView = new IntersectionObserver(
  (entries) => {
    for (const { target: video, isIntersecting } of entries) {
      if (!isIntersecting) {
        video.dataset.scrolled = "";
        video.pause();
      } else if (!still.matches && !paused.has(video)) {
        delete video.dataset.scrolled;
        video.play().catch(() => {});
      }
    }
  },
  { threshold: 0.5 },
);

for (const video of document.querySelectorAll("video")) {
  video.addEventListener("error", () => video.src.startsWith("data:") && fromBlob(video));
  video.addEventListener("pause", () => "scrolled" in video.dataset || paused.add(video));
  video.addEventListener("play", () => paused.delete(video));
  inView.observe(video);
}
