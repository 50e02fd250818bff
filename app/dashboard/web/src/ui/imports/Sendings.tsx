import { megabytes, percent } from "../../state/format";
import { selectedId } from "../../state/store";
import { dismiss, type Purpose, uploadsOf } from "../../state/uploads";
import { say } from "../../words/say";
import { Button, Trouble } from "../parts/Controls";

/** Files on their way to the service, with how much of each has gone, and why one was refused. */
export function Sendings({ purpose }: { purpose: Purpose }) {
  const sendings = uploadsOf(selectedId.value, purpose);
  return (
    <>
      {sendings.map(({ key, name, size, sent, fault, stop }) => (
        <div class="sending" key={key} data-testid={`sending-${purpose}`}>
          {fault ? (
            <>
              <Trouble words={`${name}: ${fault}`} />
              <Button kind="link-button" onClick={() => dismiss(key)}>
                {say("imports.dismiss")}
              </Button>
            </>
          ) : (
            <>
              <progress max={size} value={sent} aria-label={say("imports.sending", { name })} />
              <span role="status">
                {sent < size
                  ? say("imports.sent", {
                      name,
                      sent: percent((100 * sent) / size),
                      size: megabytes(size),
                    })
                  : say("imports.beingRead", { name })}
              </span>
              <Button kind="link-button" onClick={stop}>
                {say("mission.cancel")}
              </Button>
            </>
          )}
        </div>
      ))}
    </>
  );
}
