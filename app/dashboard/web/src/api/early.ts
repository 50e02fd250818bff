/**
 * What the page needs first, asked for while its code is still being fetched and read. This file is fetched before all
 * others and imports none of them: whoever wants an answer finds it in `asked`, by its address.
 */

declare global {
  var asked: Map<string, Promise<Response>> | undefined;
}

const session = fetch("/api/v1/session");
globalThis.asked = new Map([["/api/v1/session", session]]);

const id = /^#\/missions\/(.+)$/.exec(location.hash)?.[1];
if (id) {
  const address = `/api/v1/missions/${id}`;
  // Without a session every request would be refused, and count as one more.
  const mission = session.then((answer) => (answer.ok ? fetch(address) : answer.clone()));
  globalThis.asked.set(address, mission);
}

for (const answer of globalThis.asked.values()) {
  // Whoever takes it hears of it.
  answer.catch(() => undefined);
}

export {};
