import { useSignal } from "@preact/signals";
import { refusal, signIn } from "../state/session";
import {
  describing,
  mission,
  missions,
  panelOpen,
  selectedId,
  serviceFault,
  socketStatus,
} from "../state/store";

/** What stands in the middle when there is nothing to show, or something is wrong: always with what to do next. */
export function Notices() {
  const fault = serviceFault.value;
  const refused = refusal.value;
  return (
    <div class="notices">
      {fault?.status === 401 || fault?.status === 403 ? <SignIn /> : null}
      {fault && fault.status !== 401 && fault.status !== 403 ? (
        <p class="notice alarm" role="alert" data-testid="service-fault">
          <b>✕ {fault.message}.</b> {fault.remedy} This page connects again by itself
          {mission.value ? "; what is shown is old." : "."}
        </p>
      ) : null}
      {refused && refused.what !== "abort" ? (
        <div class="notice alarm" role="alert" data-testid="refusal">
          <p>
            <b>✕ {refused.what} was refused:</b> {refused.error.message}. {refused.error.remedy}
          </p>
          <button
            type="button"
            class="command"
            onClick={() => {
              refusal.value = null;
            }}
          >
            Taken
          </button>
        </div>
      ) : null}
      <Guide />
    </div>
  );
}

function Guide() {
  if (serviceFault.value || missions.value === null || describing.value) return null;
  if (!selectedId.value) {
    return (
      <div class="notice" data-testid="no-mission">
        <p>
          <b>No mission is shown.</b>{" "}
          {missions.value.length > 0
            ? "Choose one from the list, or describe a new one."
            : "Describe the first one."}
        </p>
        <button
          type="button"
          class="command primary"
          onClick={() => {
            panelOpen.value = true;
            describing.value = missions.value?.length === 0;
          }}
        >
          {missions.value.length > 0 ? "Show missions" : "New mission"}
        </button>
      </div>
    );
  }
  const known = missions.value.some((m) => m.id === selectedId.value);
  if (!mission.value && !known && socketStatus.value?.kind !== "open") {
    return (
      <p class="notice" data-testid="unknown-mission">
        <b>There is no mission {selectedId.value}.</b> Choose one from the list on the left.
      </p>
    );
  }
  return null;
}

function SignIn() {
  const text = useSignal("");
  const fault = serviceFault.value;
  return (
    <form
      class="notice sign-in"
      onSubmit={(event) => {
        event.preventDefault();
        signIn(text.value);
      }}
    >
      <p>
        <b>The service wants to know who you are.</b> {fault?.message}. {fault?.remedy}
      </p>
      <label class="field">
        Access token
        <input
          type="password"
          autocomplete="current-password"
          value={text.value}
          data-testid="token"
          onInput={(event) => {
            text.value = event.currentTarget.value;
          }}
        />
      </label>
      <button type="submit" class="command primary">
        Sign in
      </button>
    </form>
  );
}
