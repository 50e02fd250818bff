import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { said } from "../../state/session";
import { Trouble } from "../parts/Controls";

interface PictureProps {
  /** What it shows; another picture is fetched when that is another. */
  of: string;
  /** What it shows, for those who do not see it. */
  words: string;
  id: string;
  /** Whether single cells are to be seen. */
  cells?: boolean;
  fetch: () => Promise<{ content: Blob }>;
}

/** A picture that the service makes, with what went wrong where it cannot. */
export function Picture({ of, words, id, cells = false, fetch }: PictureProps) {
  const address = useSignal("");
  const trouble = useSignal("");
  useEffect(() => {
    let gone = false;
    trouble.value = "";
    fetch().then(
      ({ content }) => {
        if (!gone) address.value = URL.createObjectURL(content);
      },
      (error: unknown) => {
        if (!gone) trouble.value = said(error);
      },
    );
    return () => {
      gone = true;
      URL.revokeObjectURL(address.peek());
      address.value = "";
    };
  }, [of]);
  if (trouble.value) return <Trouble words={trouble.value} />;
  return address.value ? (
    <img class={`site-picture${cells ? " cells" : ""}`} src={address.value} alt={words} data-testid={id} />
  ) : (
    <div class="site-picture" aria-hidden="true" />
  );
}
