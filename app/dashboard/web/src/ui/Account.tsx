import "./Account.css";
import { useSignal } from "@preact/signals";
import { ServiceError } from "../api/client";
import { me, signedOut, signIn, signOut, whyNotCommand } from "../state/access";
import { said } from "../state/session";
import { accountOpen } from "../state/store";
import { Button, sets, Typed } from "./Controls";
import { Dialog } from "./Dialog";

/** Who uses the page, always in sight. */
export function AccountButton() {
  const who = me.value;
  if (!who) return null;
  const words = `${who.name}, role ${who.role}`;
  return (
    <Button
      id="account"
      kind={`tool account${whyNotCommand.value ? " looks-only" : ""}`}
      title={`Signed in: ${words}`}
      onClick={sets(accountOpen, true)}
    >
      <span class="account-name">{who.name}</span>
      <small>{whyNotCommand.value ? `${who.role}: looks only` : who.role}</small>
    </Button>
  );
}

export function AccountDialog() {
  const fault = useSignal("");
  const who = me.value;
  const close = sets(accountOpen, false);
  const leaving = (
    <Button
      id="sign-out"
      kind="command primary"
      onClick={() => {
        signOut().catch((error: unknown) => {
          fault.value = said(error);
        });
      }}
    >
      Sign out
    </Button>
  );
  return (
    <Dialog
      open={accountOpen.value}
      onClose={close}
      name="account"
      heading={who?.local ? "Nobody has to sign in yet" : `Signed in as ${who?.name}`}
      fault={fault.value}
      actions={who?.signed_in ? leaving : null}
    >
      {who?.local ? (
        <p>
          No access token was made, so whoever runs the service commands it from this machine.{" "}
          <code>bathyfleet token create NAME --role operator</code> makes one; from then on everybody signs
          in.
        </p>
      ) : (
        <p>
          Role {who?.role}. {whyNotCommand.value || "This role commands missions."}
        </p>
      )}
    </Dialog>
  );
}

/** Asks for an access token, which is tried once and kept nowhere. */
export function SignIn() {
  const text = useSignal("");
  const fault = useSignal("");
  const sending = useSignal(false);
  const why = signedOut.value;
  const submit = async () => {
    sending.value = true;
    fault.value = "";
    try {
      await signIn(text.value);
    } catch (error) {
      fault.value = error instanceof ServiceError && error.status === 401 ? `${error.message}.` : said(error);
    } finally {
      sending.value = false;
    }
  };
  return (
    <form
      class="notice sign-in"
      data-testid="sign-in"
      onSubmit={(event) => {
        event.preventDefault();
        void submit();
      }}
    >
      <p>
        <b>Sign in.</b>{" "}
        {why?.status === 403
          ? `${why.message}. ${why.remedy}`
          : "This service asks who you are: enter your access token. Whoever runs the service makes one."}
      </p>
      <label class="field">
        Access token
        <Typed text={text} id="token" type="password" autocomplete="current-password" />
      </label>
      <button type="submit" class="command primary" disabled={sending.value || text.value.trim() === ""}>
        {sending.value ? "Signing in…" : "Sign in"}
      </button>
      {fault.value ? (
        <p class="fault" role="alert" data-testid="sign-in-fault">
          ▲ {fault.value}
        </p>
      ) : null}
    </form>
  );
}
