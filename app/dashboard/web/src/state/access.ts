/** Who uses the page, and what he may do. The access token itself is known to no script: a cookie stands for it. */

import { computed, signal } from "@preact/signals";
import { api, type ServiceError } from "../api/client";
import type { SessionView } from "../api/types";

/** Where earlier versions kept the token for every script to read. */
const OLD_TOKEN = "bathyfleet.token";

/** null until the service has said so. */
export const me = signal<SessionView | null>(null);
/** Why nobody is signed in; null while someone is, or it is not known yet. */
export const signedOut = signal<ServiceError | null>(null);

const COMMANDING: readonly SessionView["role"][] = ["operator", "admin"];

/** Why whoever uses the page may command nothing; empty when he may. */
export const whyNotCommand = computed(() => {
  const who = me.value;
  if (!who || COMMANDING.includes(who.role)) return "";
  return `${who.name} has the role ${who.role}, which may look only: sign in with an operator's token`;
});

/** Asks who uses the page. Throws what the service refused. */
export async function identify(): Promise<void> {
  const old = takeOldToken();
  me.value = old ? await api.signIn(old).catch(() => api.session()) : await api.session();
  signedOut.value = null;
}

/** Exchanges a token for a session: once, a wrong one is not tried again. Throws what the service refused. */
export async function signIn(token: string): Promise<void> {
  await api.signIn(token.trim());
  location.reload();
}

export async function signOut(): Promise<void> {
  await api.signOut();
  location.reload();
}

/** Returns the token that an earlier version left on this device, and removes it. */
function takeOldToken(): string {
  try {
    const stored = localStorage.getItem(OLD_TOKEN);
    localStorage.removeItem(OLD_TOKEN);
    return stored ? String(JSON.parse(stored)) : "";
  } catch {
    return "";
  }
}
