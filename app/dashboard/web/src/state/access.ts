/** Who uses the page, and what he may do. The access token itself is known to no script: a cookie stands for it. */

import { computed, signal } from "@preact/signals";
import { api, type ServiceError } from "../api/client";
import type { SessionView } from "../api/types";
import { type Key, say } from "../words/say";

/** Where earlier versions kept the token for every script to read. */
const OLD_TOKEN = "bathyfleet.token";

/** null until the service has said so. */
export const me = signal<SessionView | null>(null);
/** Why nobody is signed in; null while someone is, or it is not known yet. */
export const signedOut = signal<ServiceError | null>(null);

const ROLE_KEYS = {
  viewer: "access.viewer",
  vehicle: "access.vehicle",
  operator: "access.operator",
  admin: "access.admin",
} as const satisfies Record<SessionView["role"], Key>;

export const roleWords = (role: SessionView["role"]): string => say(ROLE_KEYS[role]);

const COMMANDING: readonly SessionView["role"][] = ["operator", "admin"];

/** Why whoever uses the page may command nothing; empty when he may. */
export const whyNotCommand = computed(() => {
  const who = me.value;
  if (!who || COMMANDING.includes(who.role)) return "";
  return say("access.hasTheRoleWhichMayLook", { who: who.name, role: roleWords(who.role) });
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
