import "./Account.css";
import { useSignal } from "@preact/signals";
import { ServiceError } from "../api/client";
import { me, roleWords, signedOut, signIn, signOut, whyNotCommand } from "../state/access";
import { said } from "../state/session";
import { accountOpen } from "../state/store";
import { say, sayWith } from "../words/say";
import { Button, sets, Typed } from "./parts/Controls";
import { Dialog } from "./parts/Dialog";

/** Who uses the page, always in sight. */
export function AccountButton() {
  const who = me.value;
  if (!who) return null;
  const words = say("account.role", { who: who.name, role: roleWords(who.role) });
  return (
    <Button
      id="account"
      kind={`tool account${whyNotCommand.value ? " looks-only" : ""}`}
      title={say("account.signedIn", { words })}
      onClick={sets(accountOpen, true)}
    >
      <span class="account-name">{who.name}</span>
      <small>
        {whyNotCommand.value ? say("account.looksOnly", { role: roleWords(who.role) }) : roleWords(who.role)}
      </small>
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
      {say("account.signOut")}
    </Button>
  );
  return (
    <Dialog
      open={accountOpen.value}
      onClose={close}
      name="account"
      heading={
        who?.local ? say("account.nobodyHasToSignInYet") : say("account.signedInAs", { who: who?.name ?? "" })
      }
      fault={fault.value}
      actions={who?.signed_in ? leaving : null}
    >
      {who?.local ? (
        <p>
          {sayWith("account.noAccessTokenWasMadeSo", {
            code: <code>bathyfleet token create NAME --role operator</code>,
          })}
        </p>
      ) : (
        <p>
          {say("account.role2", {
            role: who ? roleWords(who.role) : "",
            whyNotCommand: whyNotCommand.value || say("account.thisRoleCommandsMissions"),
          })}
        </p>
      )}
    </Dialog>
  );
}

const SIGN_IN_FORM = "sign-in-form";

/** Asks for an access token, which is tried once and kept nowhere. */
export function SignIn() {
  const text = useSignal("");
  const fault = useSignal("");
  const sending = useSignal(false);
  const why = signedOut.value;
  const submit = async () => {
    if (sending.peek()) return;
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
      id={SIGN_IN_FORM}
      class="notice sign-in"
      data-testid="sign-in"
      onSubmit={(event) => {
        event.preventDefault();
        void submit();
      }}
    >
      <p>
        <b>{say("account.signIn")}</b>{" "}
        {why?.status === 403 ? `${why.message}. ${why.remedy}` : say("account.thisServiceAsksWhoYouAre")}
      </p>
      <label class="field">
        {say("account.accessToken")}
        <Typed text={text} id="token" type="password" autocomplete="current-password" />
      </label>
      <Button
        id="send-token"
        kind="command primary"
        disabled={text.value.trim() === ""}
        busy={sending.value}
        form={SIGN_IN_FORM}
      >
        {sending.value ? say("account.signingIn") : say("account.signIn2")}
      </Button>
      {fault.value ? (
        <p class="fault" role="alert" data-testid="sign-in-fault">
          ▲ {fault.value}
        </p>
      ) : null}
    </form>
  );
}
