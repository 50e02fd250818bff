import { say } from "../words/say";
import type {} from "./early";
import type {
  ActionView,
  AdjustmentView,
  AlarmReport,
  AlarmView,
  BeamEditsView,
  BeamEditView,
  BeamPoints,
  BeamSelection,
  Budget,
  CastRules,
  CastsView,
  ChangesView,
  CorrectionsView,
  CrossoversView,
  DoctorView,
  DrawingView,
  EventView,
  FieldProblem,
  ForecastView,
  Holidays,
  ImportOptions,
  ImportView,
  LayerView,
  LngLat,
  LogView,
  MissionAction,
  MissionSummary,
  MissionView,
  MountingEstimateView,
  MountingSpec,
  NamedBeams,
  NewCasts,
  NewMission,
  NewSite,
  OrderView,
  PlannerView,
  PlanView,
  PolygonGeometry,
  PreflightView,
  Problem,
  ProductView,
  ProfileView,
  ProposedZonesView,
  QualityView,
  ReferenceView,
  RulingsView,
  SearchGridView,
  SessionView,
  SiteChanges,
  SiteView,
  SoundingPage,
  SoundingPoints,
  SoundingState,
  SoundingView,
  SoundSpeed,
  StepView,
  SurveyView,
  SystematicErrors,
  SystematicErrorsView,
  TelemetryView,
  TideCorrection,
  TimedTracks,
  TrafficView,
  VehicleCastView,
  VehicleView,
} from "./types";
import { upload } from "./upload";

const BASE = "/api/v1";
const LOG_PAGE = 1000;
/** How long an answer is waited for, and what is to be done where none came. */
interface Patience {
  limit_ms: number;
  otherwise: "service.mayHaveBeenDone" | "service.checkThatItIsRunningAnd";
}

/** Stops take seconds, and nobody gives an order again while it waits for an answer. */
const ORDERED: Patience = { limit_ms: 20_000, otherwise: "service.mayHaveBeenDone" };
/** Where soundings and maps may follow. */
const STORED: Patience = { limit_ms: 120_000, otherwise: "service.mayHaveBeenDone" };
/** What is asked for again and again: few requests may wait at a time, and a stop is one of them. */
const POLLED: Patience = { limit_ms: 15_000, otherwise: "service.checkThatItIsRunningAnd" };

/** The service refused a request, or could not be reached. Its message is meant for the operator. */
export class ServiceError extends Error {
  constructor(
    message: string,
    readonly status: number,
    readonly remedy = "",
    readonly faults: readonly FieldProblem[] = [],
  ) {
    super(message);
  }
}

/** Turns an answer that is not a success into an error that says what the service said. */
export async function toServiceError(response: Response): Promise<ServiceError> {
  try {
    const problem = (await response.json()) as Partial<Problem>;
    return new ServiceError(
      problem.detail || problem.title || say("service.theServiceAnswered", { status: response.status }),
      response.status,
      problem.remedy ?? "",
      problem.errors ?? [],
    );
  } catch {
    return new ServiceError(
      say("service.theServiceAnswered2", { status: response.status, statusText: response.statusText }),
      response.status,
    );
  }
}

async function request<T>(path: string, init: RequestInit = {}, patience?: Patience): Promise<T> {
  const headers = new Headers(init.headers);
  headers.set("Accept", "application/json");
  const answer = async (gone: Pick<RequestInit, "signal">) =>
    (await ask(`${BASE}${path}`, { ...init, headers, ...gone })).json() as Promise<T>;
  return patience ? within(patience, (signal) => answer({ signal })) : answer({});
}

/** What is answered within a time; throws that nothing was. */
async function within<T>(
  { limit_ms, otherwise }: Patience,
  answer: (gone: AbortSignal) => Promise<T>,
): Promise<T> {
  const gone = new AbortController();
  let timer: ReturnType<typeof setTimeout> | undefined;
  const late = new Promise<never>((_, refuse) => {
    timer = setTimeout(() => {
      refuse(new ServiceError(say("service.noAnswerWithin", { limit: limit_ms / 1000 }), 0));
      gone.abort();
    }, limit_ms);
  });
  try {
    return await Promise.race([answer(gone.signal), late]);
  } catch (error) {
    if (error instanceof ServiceError && error.status === 0)
      throw new ServiceError(error.message, 0, say(otherwise));
    throw error;
  } finally {
    clearTimeout(timer);
  }
}

/** After so long an answer that was asked for before the page ran tells what was. */
const EARLY_MS = 10_000;

/** The answer that was asked for while the page was read, once. */
function takeEarly(address: string, { method = "GET" }: RequestInit): Promise<Response> | undefined {
  const answer =
    method === "GET" && performance.now() < EARLY_MS ? globalThis.asked?.get(address) : undefined;
  globalThis.asked?.delete(address);
  return answer;
}

/** The answer to a request; throws what the service refused, or that it does not answer. */
async function ask(address: string, init: RequestInit): Promise<Response> {
  let response: Response;
  try {
    response = await (takeEarly(address, init) ?? fetch(address, init));
  } catch (error) {
    if (init.signal?.aborted) throw error;
    throw new ServiceError(say("service.theServiceDoesNotAnswer"), 0, say("service.checkThatItIsRunningAnd"));
  }
  if (!response.ok) throw await toServiceError(response);
  return response;
}

/** A file, fetched rather than linked to, so that what goes wrong is said. `onBytes` is told how much has come. */
async function file(
  address: string,
  onBytes: (received: number) => void = () => {},
  gone?: AbortSignal,
): Promise<{ name: string; content: Blob }> {
  const response = await ask(address, gone ? { signal: gone } : {});
  const name = /filename="([^"]+)"/.exec(response.headers.get("Content-Disposition") ?? "")?.[1];
  const type = response.headers.get("Content-Type") ?? "application/octet-stream";
  const parts: BlobPart[] = [];
  let received = 0;
  const reader = response.body?.getReader();
  for (let part = await reader?.read(); part && !part.done; part = await reader?.read()) {
    parts.push(part.value);
    received += part.value.byteLength;
    onBytes(received);
  }
  return { name: name ?? "bathyfleet", content: new Blob(parts, { type }) };
}

/** What answers nothing when it succeeds. */
async function remove(path: string): Promise<void> {
  const init = { method: "DELETE", headers: { Accept: "application/json" } };
  await within(ORDERED, (gone) => ask(`${BASE}${path}`, { ...init, signal: gone }));
}

function post<T>(path: string, body?: unknown, patience = ORDERED): Promise<T> {
  return request<T>(
    path,
    {
      method: "POST",
      ...(body === undefined
        ? {}
        : { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } }),
    },
    patience,
  );
}

const mountingPath = (id: string, vehicle: string) =>
  `${missionPath(id)}/mountings/${encodeURIComponent(vehicle)}`;

const put = <T>(path: string, body: unknown): Promise<T> =>
  request<T>(
    path,
    { method: "PUT", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } },
    STORED,
  );

/** What is asked for again and again. */
const poll = <T>(path: string): Promise<T> => request<T>(path, {}, POLLED);

const missionPath = (id: string) => `/missions/${encodeURIComponent(id)}`;
const vehiclePath = (id: string, name: string) => `${missionPath(id)}/vehicles/${encodeURIComponent(name)}`;

const sitePath = (id: string, part = "") => `/sites/${encodeURIComponent(id)}${part && `/${part}`}`;

/** Beams by what they have in common, or one by one. */
export type WhichBeams = { selection: BeamSelection } | { pings: readonly NamedBeams[] };

/** Which two surveys are compared, by their missions; empty: the newest that can be. */
export interface Compared {
  from: string;
  to: string;
}

export const NEWEST_TWO: Compared = { from: "", to: "" };

function between(compared: Compared): string {
  const given = Object.entries(compared).filter(([, mission]) => mission !== "");
  return given.length > 0 ? `?${new URLSearchParams(given)}` : "";
}

/** A file on its way: `onBytes` is told how much has gone. */
export interface Sending {
  file: File;
  onBytes: (sent: number) => void;
  gone: AbortSignal;
}

function send<T>(method: "POST" | "PUT", path: string, query: object, { file, onBytes, gone }: Sending) {
  const said = Object.entries({ ...query, filename: file.name }).filter(([, value]) => value !== "");
  return upload<T>(method, `${BASE}${path}?${new URLSearchParams(said)}`, file, onBytes, gone);
}

/** A mission that nobody has created, and how deep it is there; empty: not known. */
export interface Described {
  mission: NewMission;
  floor_depth_m: string;
}

const atDepth = (floor_depth_m: string): string =>
  floor_depth_m.trim() === "" ? "" : `?${new URLSearchParams({ floor_depth_m: floor_depth_m.trim() })}`;

export const api = {
  session: () => poll<SessionView>("/session"),
  signIn: (token: string) =>
    request<SessionView>(
      "/session",
      { method: "POST", headers: { Authorization: `Bearer ${token}` } },
      POLLED,
    ),
  signOut: () => remove("/session"),
  missions: () => poll<MissionSummary[]>("/missions"),
  doctor: () => poll<DoctorView>("/doctor"),
  traffic: () => poll<TrafficView>("/traffic"),
  vehicles: () => poll<VehicleView[]>("/vehicles"),
  layers: () => poll<LayerView[]>("/layers"),
  planners: () => request<PlannerView[]>("/planners"),
  create: (mission: NewMission) => post<MissionView>("/missions", mission, STORED),
  /** Replaces what a mission is to do that has not started. */
  describe: (id: string, mission: NewMission) => put<MissionView>(missionPath(id), mission),
  /** `confirmed`: which questions of its checklist somebody has looked at. */
  start: (id: string, confirmed: readonly string[]) =>
    post<ActionView>(`${missionPath(id)}/start`, { confirmed }),
  /** `home`: whether vehicles go home before the mission ends; undefined: as the service does it. */
  act: (id: string, action: MissionAction, home?: boolean) =>
    post<ActionView>(`${missionPath(id)}/${action}`, home === undefined ? undefined : { return: home }),
  /** Makes a mission longer or shorter, while it runs as well. */
  setBudget: (id: string, budget: Budget) => put<MissionView>(`${missionPath(id)}/budget`, budget),
  log: readLog,
  mission: (id: string) => request<MissionView>(missionPath(id)),
  deleteMission: (id: string) => remove(missionPath(id)),
  preflight: (id: string) => poll<PreflightView>(`${missionPath(id)}/preflight`),
  forecast: (id: string, depth_m: string, gone: AbortSignal) =>
    request<ForecastView>(`${missionPath(id)}/forecast${atDepth(depth_m)}`, { method: "POST", signal: gone }),
  forecastOf: ({ mission, floor_depth_m }: Described, gone: AbortSignal) =>
    request<ForecastView>(`/forecast${atDepth(floor_depth_m)}`, {
      method: "POST",
      signal: gone,
      body: JSON.stringify(mission),
      headers: { "Content-Type": "application/json" },
    }),
  plan: ({ mission, floor_depth_m }: Described, gone: AbortSignal) =>
    request<PlanView>(`/plan${atDepth(floor_depth_m)}`, {
      method: "POST",
      signal: gone,
      body: JSON.stringify(mission),
      headers: { "Content-Type": "application/json" },
    }),
  steps: (id: string, after: number) =>
    request<StepView[]>(`${missionPath(id)}/steps?after=${after}&limit=1000`),
  telemetry: (id: string) => request<TelemetryView>(`${missionPath(id)}/telemetry`),
  tracks: (id: string) => request<TimedTracks>(`${missionPath(id)}/tracks.geojson`),
  acknowledge: (alarm: string) => post<AlarmView>(`/alarms/${encodeURIComponent(alarm)}/acknowledge`),
  /** With who was told of it. */
  alarm: (alarm: string) => poll<AlarmReport>(`/alarms/${encodeURIComponent(alarm)}`),
  note: (id: string, text: string) => post<EventView>(`${missionPath(id)}/notes`, { text }),
  abortVehicle: (id: string, name: string) => post<ActionView>(`${vehiclePath(id, name)}/abort`),
  rejoin: (id: string, name: string) => post<MissionView>(`${vehiclePath(id, name)}/rejoin`),
  returnVehicle: (id: string, name: string) => post<MissionView>(`${vehiclePath(id, name)}/return`),
  holdVehicle: (id: string, name: string) => post<MissionView>(`${vehiclePath(id, name)}/hold`),
  resumeVehicle: (id: string, name: string) => post<MissionView>(`${vehiclePath(id, name)}/resume`),
  goVehicle: (id: string, name: string, position: LngLat) =>
    post<OrderView>(`${vehiclePath(id, name)}/go`, { position }),
  skipLine: (id: string, name: string) => post<OrderView>(`${vehiclePath(id, name)}/skip-line`),
  repeatLine: (id: string, name: string, near: LngLat | null) =>
    post<OrderView>(`${vehiclePath(id, name)}/repeat-line`, { near }),
  denser: (id: string, area: PolygonGeometry, line_spacing_m: number | null, vehicle: string | null) =>
    post<OrderView>(`${missionPath(id)}/denser`, { area, line_spacing_m, vehicle }),
  soundings: (id: string, after: number, state?: SoundingState) =>
    request<SoundingPage>(
      `${missionPath(id)}/soundings?limit=200&after=${after}${state ? `&state=${state}` : ""}`,
    ),
  soundingPoints: (id: string, after: number, gone: AbortSignal) =>
    request<SoundingPoints>(`${missionPath(id)}/soundings/points?after=${after}`, { signal: gone }),
  ruleMany: (id: string, ids: readonly number[], ruling: "restore" | "reject", note: string) =>
    post<RulingsView>(`${missionPath(id)}/soundings/${ruling}`, { ids, note }, STORED),
  /** Beams of a selection as points; of very many those of some pings. It takes as long as it takes. */
  beamPoints: (id: string, selection: BeamSelection, gone: AbortSignal) =>
    request<BeamPoints>(`${missionPath(id)}/beams/points`, {
      method: "POST",
      body: JSON.stringify(selection),
      headers: { "Content-Type": "application/json" },
      signal: gone,
    }),
  ruleBeams: (id: string, ruling: "restore" | "reject", which: WhichBeams, note: string) =>
    post<BeamEditView>(`${missionPath(id)}/beams/${ruling}`, { ...which, note }, STORED),
  beamEdits: (id: string) => request<BeamEditsView>(`${missionPath(id)}/beams/edits`),
  withdrawBeamEdit: (id: string, edit: number) =>
    request<BeamEditsView>(`${missionPath(id)}/beams/edits/${edit}`, { method: "DELETE" }, STORED),
  rule: (id: string, sounding: number, ruling: "restore" | "reject", note: string) =>
    post<SoundingView>(`${missionPath(id)}/soundings/${sounding}/${ruling}`, { note }, STORED),
  corrections: (id: string) => request<CorrectionsView>(`${missionPath(id)}/corrections`),
  setTide: (id: string, tide: Partial<TideCorrection>) =>
    put<CorrectionsView>(`${missionPath(id)}/tide`, tide),
  setSoundSpeed: (id: string, speed: Partial<SoundSpeed>) =>
    put<CorrectionsView>(`${missionPath(id)}/sound-speed`, speed),
  deleteSoundSpeed: (id: string) =>
    request<CorrectionsView>(`${missionPath(id)}/sound-speed`, { method: "DELETE" }),
  casts: (id: string) => request<CastsView>(`${missionPath(id)}/sound-speed/casts`),
  measuredCasts: (id: string) => request<VehicleCastView[]>(`${missionPath(id)}/sound-speed/measured`),
  addCasts: (id: string, casts: NewCasts) =>
    post<CorrectionsView>(`${missionPath(id)}/sound-speed/casts`, casts, STORED),
  deleteCast: (id: string, name: string) =>
    request<CorrectionsView>(`${missionPath(id)}/sound-speed/casts/${encodeURIComponent(name)}`, {
      method: "DELETE",
    }),
  setCastRule: (id: string, rules: CastRules) =>
    put<CorrectionsView>(`${missionPath(id)}/sound-speed/rule`, rules),
  setMounting: (id: string, vehicle: string, mounting: MountingSpec) =>
    put<CorrectionsView>(mountingPath(id, vehicle), mounting),
  deleteMounting: (id: string, vehicle: string) =>
    request<CorrectionsView>(mountingPath(id, vehicle), { method: "DELETE" }),
  /** What overlapping lines say; nothing is changed by it, and it takes as long as it takes. */
  estimateMounting: (id: string, vehicle: string, gone: AbortSignal) =>
    request<MountingEstimateView>(`${mountingPath(id, vehicle)}/estimate`, { method: "POST", signal: gone }),
  logs: (id: string) => poll<LogView[]>(`${missionPath(id)}/logs`),
  /** `vehicle`: empty where the log says whose it is. */
  sendLog: (id: string, vehicle: string, sending: Sending) =>
    send<LogView>("POST", `${missionPath(id)}/logs`, { vehicle }, sending),
  deleteLog: (id: string, one: string) =>
    request<LogView>(`${missionPath(id)}/logs/${encodeURIComponent(one)}`, { method: "DELETE" }, STORED),
  imports: (id: string) => request<ImportView[]>(`${missionPath(id)}/imports`),
  sendImport: (id: string, options: ImportOptions, sending: Sending) =>
    send<ImportView>("POST", `${missionPath(id)}/imports`, options, sending),
  deleteImport: (id: string, one: string) => remove(`${missionPath(id)}/imports/${encodeURIComponent(one)}`),
  reference: (id: string) => request<ReferenceView>(`${missionPath(id)}/reference`),
  sendReference: (id: string, options: ImportOptions, sending: Sending) =>
    send<ReferenceView>("PUT", `${missionPath(id)}/reference`, options, sending),
  deleteReference: (id: string) => remove(`${missionPath(id)}/reference`),
  /** What a chart shows to keep out of between these degrees. */
  proposeZones: (
    ends: Record<"west_deg" | "south_deg" | "east_deg" | "north_deg", string>,
    { file, onBytes, gone }: Sending,
  ) =>
    upload<ProposedZonesView>(
      "POST",
      `${BASE}/chart-zones?${new URLSearchParams(ends)}`,
      file,
      onBytes,
      gone,
    ),
  /** The lines and areas of a file of plans; `crs`: what its positions are in where it does not say. */
  readDrawing: (crs: string, { file, onBytes, gone }: Sending) =>
    upload<DrawingView>(
      "POST",
      `${BASE}/drawings?${new URLSearchParams({ filename: file.name, ...(crs ? { crs } : {}) })}`,
      file,
      onBytes,
      gone,
    ),
  mapTiles,
  site: (id: string) => request<SearchGridView>(`${missionPath(id)}/search`),
  crossovers: (id: string) => request<CrossoversView>(`${missionPath(id)}/crosslines`),
  systematicErrors: (id: string) => request<SystematicErrorsView>(`${missionPath(id)}/systematic-errors`),
  setSystematicErrors: (id: string, errors: SystematicErrors) =>
    put<unknown>(`${missionPath(id)}/systematic-errors`, errors),
  deleteSystematicErrors: (id: string) =>
    request<unknown>(`${missionPath(id)}/systematic-errors`, { method: "DELETE" }),
  adjustment: (id: string) => request<AdjustmentView>(`${missionPath(id)}/adjustment`),
  adjust: (id: string) =>
    request<AdjustmentView>(`${missionPath(id)}/adjustment`, {
      method: "POST",
      body: "{}",
      headers: { "Content-Type": "application/json" },
    }),
  undoAdjustment: (id: string) =>
    request<AdjustmentView>(`${missionPath(id)}/adjustment`, { method: "DELETE" }),
  holidays: (id: string) => request<Holidays>(`${missionPath(id)}/holidays`),
  profile: (id: string, line: string, layers: readonly string[], gone: AbortSignal) => {
    const query = new URLSearchParams({ line });
    for (const layer of layers) query.append("layer", layer);
    return request<ProfileView>(`${missionPath(id)}/profile?${query}`, { signal: gone });
  },
  products: (id: string) => request<ProductView[]>(`${missionPath(id)}/products`),
  sites: () => request<SiteView[]>("/sites"),
  createSite: (site: NewSite) => post<SiteView>("/sites", site),
  surveys: (site: string) => request<SurveyView[]>(sitePath(site, "surveys")),
  changeSite: (site: string, changes: SiteChanges) =>
    request<SiteView>(
      sitePath(site),
      { method: "PATCH", body: JSON.stringify(changes), headers: { "Content-Type": "application/json" } },
      STORED,
    ),
  deleteSite: (site: string) => remove(sitePath(site)),
  changes: (site: string, compared: Compared) =>
    request<ChangesView>(`${sitePath(site, "changes")}${between(compared)}`),
  siteMapFile: (site: string, format: string, crs = "") =>
    file(`${BASE}${sitePath(site, `map.${format}`)}${crs && `?${new URLSearchParams({ crs })}`}`),
  changesFile: (site: string, format: string, compared: Compared) =>
    file(`${BASE}${sitePath(site, `changes.${format}`)}${between(compared)}`),
  quality: (id: string) => request<QualityView>(`${missionPath(id)}/quality`),
  file,
};

/** What changed in the map since the one named; `step`: as it was at the end of that step. */
async function mapTiles(
  id: string,
  since: string,
  further: readonly string[],
  step: number | null,
): Promise<ArrayBuffer> {
  const query = new URLSearchParams({ since });
  for (const layer of further) query.append("layer", layer);
  if (step !== null) query.set("step", String(step));
  return (await ask(`${BASE}${missionPath(id)}/map/tiles?${query}`, {})).arrayBuffer();
}

/** The log between two of its lines, however long. */
async function readLog(id: string, after: number, last: number): Promise<EventView[]> {
  const lines: EventView[] = [];
  while (after < last) {
    const page = await request<EventView[]>(`${missionPath(id)}/events?after=${after}&limit=${LOG_PAGE}`);
    lines.push(...page);
    const end = page.at(-1);
    if (!end) break;
    after = end.id;
  }
  return lines;
}

export function liveUrl(id: string, page: Location = window.location): string {
  return `${page.protocol === "https:" ? "wss" : "ws"}://${page.host}${BASE}${missionPath(id)}/live`;
}
