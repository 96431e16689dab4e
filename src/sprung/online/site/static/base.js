// Times in the viewer's zone, and pages that follow what happens without a reload.

const zone = Intl.DateTimeFormat().resolvedOptions().timeZone || "UTC";

export function age(milliseconds) {
  const minutes = (Date.now() - milliseconds) / 60000;
  if (minutes < 1) return "just now";
  if (minutes < 90) return `${Math.round(minutes)} min ago`;
  if (minutes < 36 * 60) return `${Math.round(minutes / 60)} h ago`;
  return `${Math.round(minutes / 1440)} days ago`;
}

const pad = (number) => String(number).padStart(2, "0");

export function moment(milliseconds) {
  const at = new Date(milliseconds);
  const day = `${at.getFullYear()}-${pad(at.getMonth() + 1)}-${pad(at.getDate())}`;
  return `${day} ${pad(at.getHours())}:${pad(at.getMinutes())}`;
}

export function showTimes(root = document) {
  for (const element of root.querySelectorAll("time[datetime]")) {
    const at = Date.parse(element.dateTime);
    element.textContent = element.classList.contains("age") ? age(at) : moment(at);
    if (element.classList.contains("age")) element.title = moment(at);
  }
  for (const element of root.querySelectorAll("[data-time]")) element.textContent = moment(Date.parse(element.dataset.time));
}

/** Send a request that changes something; the answer is its JSON, or an Error with the server's sentence. */
export async function act(path, body, method = "POST") {
  const answer = await fetch(path, {
    method,
    headers: { "Content-Type": "application/json", "X-CSRF-Token": document.body.dataset.csrfToken },
    body: JSON.stringify(body),
  });
  const document_ = await answer.json();
  if (!answer.ok) throw new Error(document_.detail);
  return document_;
}

/** Replace parts of the page that have an id and data-live by those of the page as it is now. */
export async function refresh() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" } });
  if (!answer.ok) return;
  const now = new DOMParser().parseFromString(await answer.text(), "text/html");
  for (const part of document.querySelectorAll("[data-live][id]")) {
    const next = now.getElementById(part.id);
    if (!next || part.contains(document.activeElement)) continue;
    part.replaceChildren(...next.childNodes);
    showTimes(part);
  }
  document.dispatchEvent(new Event("sprung:refreshed"));
}

let waiting = null;

/** Refresh soon, but at most once in two seconds. */
function soon() {
  if (waiting === null) waiting = setTimeout(() => { waiting = null; refresh(); }, 2000);
}

function follow() {
  const live = document.getElementById("live");
  const vehicle = document.body.dataset.vehicle;
  const source = new EventSource("/api/v1/events");
  source.onopen = () => { live.textContent = "live"; };
  source.onerror = () => { live.textContent = "not live: reconnecting"; };
  for (const kind of ["alert", "window"]) {
    source.addEventListener(kind, (event) => {
      const data = JSON.parse(event.data);
      if (!vehicle || data.vehicle === vehicle) {
        document.dispatchEvent(new CustomEvent(`sprung:${kind}`, { detail: data }));
        soon();
      }
    });
  }
  addEventListener("pagehide", () => source.close());
  // Without an event, too, as vehicles appear and fall silent: once a minute, or sooner while a list is empty.
  let turn = 0;
  setInterval(() => {
    turn += 1;
    if (!document.hidden && (turn % 12 === 0 || document.querySelector("[data-live] .empty"))) soon();
  }, 5000);
}

/** Show the sentences of an answer that takes long, where there are any. */
async function showSentences(part) {
  const answer = await fetch(part.dataset.sentences);
  if (!answer.ok) return;
  const { sentences } = await answer.json();
  part.textContent = sentences.map((text) => `${text[0].toUpperCase()}${text.slice(1)}.`).join(" ");
  part.hidden = !sentences.length;
}

document.getElementById("zone").textContent = zone;
document.querySelectorAll("[data-sentences]").forEach(showSentences);
showTimes();
setInterval(showTimes, 30000);
if (document.querySelector("[data-live]")) follow();
