/** The shapes of the service's answers, from its OpenAPI document (schema.d.ts, made by `npm run schema`). */

import type { components } from "./schema";

type Schemas = components["schemas"];

/** Answers carry every field, also those that a request may leave out. */
type Complete<T> = T extends object ? { [K in keyof T]-?: Complete<T[K]> } : T;

export type LngLat = [longitude: number, latitude: number];
/** A place where something was, with its depth in metres where that is known. */
export type Place = readonly [longitude: number, latitude: number, depth_m?: number | undefined];

export type MissionState = Schemas["MissionState"];
export type LinkState = Schemas["LinkState"];
export type WaypointStatus = Schemas["WaypointStatus"];
export type Severity = Schemas["Severity"];
export type Level = Schemas["Level"];
export type MissionAction = Schemas["Action"];
export type Phase = Schemas["Phase"];
export type Failsafe = Schemas["Failsafe"];
export type FailsafeView = Schemas["FailsafeView"];
export type BatteryState = Schemas["BatteryState"];

export type PolygonGeometry = Schemas["PolygonGeometry"];
export type VehicleView = Complete<Schemas["VehicleView"]>;
export type PositionQuality = Schemas["PositionQuality"];
export type TargetState = Schemas["TargetState"];
export type TargetView = Complete<Schemas["TargetView"]>;
export type ShipView = Complete<Schemas["ShipView"]>;
export type OwnShipView = Complete<Schemas["OwnShipView"]>;
export type TrafficView = Complete<Schemas["TrafficView"]>;
export type SearchProgress = Complete<Schemas["SearchProgress"]>;
export type SearchGridView = Complete<Schemas["SearchGridView"]>;
export type CurrentView = Complete<Schemas["CurrentView"]>;
export type WaypointView = Complete<Schemas["WaypointView"]>;
export type MissionSummary = Complete<Schemas["MissionSummary"]>;
export type MissionView = Complete<Schemas["MissionView"]>;
export type OrderView = Complete<Schemas["OrderView"]>;
export type AlarmReport = Complete<Schemas["AlarmReport"]>;
export type AlarmView = Complete<Schemas["AlarmView"]>;
export type EventView = Complete<Schemas["EventView"]>;
export type StepView = Complete<Schemas["StepView"]>;
export type ForecastView = Complete<Schemas["ForecastView"]>;
export type BeamEditsView = Complete<Schemas["BeamEditsView"]>;
export type BeamEditView = Complete<Schemas["BeamEditView"]>;
export type BeamPoints = Complete<Schemas["BeamPoints"]>;
export type BeamSelection = Schemas["BeamSelection"];
export type NamedBeams = Schemas["NamedBeams"];
export type SoundingPoints = Complete<Schemas["SoundingPoints"]>;
export type RulingsView = Complete<Schemas["RulingsView"]>;
export type PlanView = Complete<Schemas["PlanView"]>;
export type ProfileView = Complete<Schemas["ProfileView"]>;
export type TelemetryView = Complete<Schemas["TelemetryView"]>;
export type PreflightView = Complete<Schemas["PreflightView"]>;
export type CheckView = Complete<Schemas["CheckView"]>;
export type CheckStatus = Schemas["CheckStatus"];
export type SoundingView = Complete<Schemas["SoundingView"]>;
export type SoundingPage = Complete<Schemas["SoundingPage"]>;
export type SoundingState = Schemas["SoundingState"];
export type SiteView = Complete<Schemas["SiteView"]>;
export type SurveyView = Complete<Schemas["SurveyView"]>;
export type ChangesView = Complete<Schemas["ChangesView"]>;
export type SiteChanges = Pick<Schemas["SiteChanges"], "name" | "cell_m" | "yearly_change_m">;
export type NewSite = Pick<Schemas["SiteSpec"], "name" | "area" | "cell_m">;
export type LayerView = Complete<Schemas["LayerView"]>;
export type ProductView = Complete<Schemas["ProductView"]>;
export type QualityView = Complete<Schemas["QualityView"]>;
export type SystematicErrors = Complete<Schemas["SystematicErrors"]>;
export type SystematicErrorView = Complete<Schemas["SystematicErrorView"]>;
export type CorrectionsView = Complete<Schemas["CorrectionsView"]>;
export type LogView = Complete<Schemas["LogView"]>;
export type ImportView = Complete<Schemas["ImportView"]>;
export type ReferenceView = Complete<Schemas["ReferenceView"]>;
export type DrawingView = Complete<Schemas["DrawingView"]>;
export type SurveyLine = Schemas["SurveyLine"];
export type ProposedZonesView = Complete<Schemas["ProposedZonesView"]>;
/** What a file of depths does not say by itself, as it is typed; empty: nothing is said. */
export type ImportOptions = Record<
  "crs" | "positive" | "sd_m" | "order" | "datum_offset_m" | "source",
  string
>;
export type TideCorrection = Schemas["TideCorrection"];
export type CastsView = Complete<Schemas["CastsView"]>;
export type CastView = Complete<Schemas["CastView"]>;
export type NewCasts = Schemas["NewCasts"];
export type CastRules = Schemas["CastRules"];
export type MountingSpec = Schemas["MountingSpec"];
export type MountingView = Complete<Schemas["MountingView"]>;
export type VehicleCastView = Complete<Schemas["VehicleCastView"]>;
export type MountingEstimateView = Complete<Schemas["MountingEstimateView"]>;
export type MountingParameter = Schemas["MountingParameter"];
export type SoundSpeed = Schemas["SoundSpeed"];
export type SystematicErrorsView = Complete<Schemas["SystematicErrorsView"]>;
export type AdjustmentView = Complete<Schemas["AdjustmentView"]>;
export type TieView = Complete<Schemas["TieView"]>;
export type CrossoversView = Complete<Schemas["CrossoversView"]>;
export type CrossingView = Complete<Schemas["CrossingView"]>;
export type AgreementView = Complete<Schemas["AgreementView"]>;
export type AngleAgreementView = Complete<Schemas["AngleAgreementView"]>;
export type PlannerView = Complete<Schemas["PlannerView"]>;
export type ActionView = Complete<Schemas["ActionView"]>;
export type DoctorView = Complete<Schemas["DoctorView"]>;
export type VehicleDiagnosis = Complete<Schemas["VehicleDiagnosis"]>;
export type Finding = Complete<Schemas["Finding"]>;
export type StopView = Complete<Schemas["StopView"]>;
export type LiveMessage = Complete<Schemas["LiveMessage"]>;
export type SessionView = Complete<Schemas["SessionView"]>;
export type Problem = Complete<Schemas["Problem"]>;
export type FieldProblem = Complete<Schemas["FieldProblem"]>;

/** What a request says of a vehicle; whatever is left out takes the service's default. */
export type VehicleSpec = Pick<Schemas["VehicleSpec"], "name" | "kind" | "sensor"> & {
  start?: LngLat | null;
  depth_m?: number;
  speed_mps?: number;
  altitude_m?: number;
  endurance_min?: number;
  recovery_point?: LngLat;
  sonar?: Partial<Schemas["SwathSonarSpec"]> | null;
};
export type Sensor = Schemas["Sensor"];
export type PlannerOptions = Partial<Schemas["PlannerOptions"]>;

/** How long a mission is. */
export type Budget = Schemas["Budget"];

/** What the form sends. */
export type NewMission = Pick<Schemas["MissionSpec"], "name" | "area" | "keep_out" | "cell_m"> & {
  survey_lines?: readonly SurveyLine[];
  coverage?: Partial<Schemas["CoverageSpec"]>;
  kind?: Schemas["MissionKind"];
  site?: string | null;
  site_prior?: boolean;
  after?: string | null;
  vehicles: VehicleSpec[];
  budget?: Schemas["Budget"];
  speed_mps?: number;
  accuracy_m?: number;
  limits: Partial<Schemas["Limits"]>;
  planner?: { name: string; options: PlannerOptions };
  search?: Pick<
    Schemas["SearchSpec"],
    "goal" | "goal_radius_m" | "entry" | "window_s" | "safety_m" | "scanner" | "obstacles"
  >;
  tide?: Partial<Schemas["Tide"]>;
  sound_speed?: Schemas["SoundSpeed"] | null;
  systematic_errors?: Partial<Schemas["SystematicErrors"]>;
  recovery?: { point: LngLat } & Partial<Schemas["Recovery"]>;
};

/** What a swath survey missed, as its GeoJSON says, largest first; `version` is the map's. */
export interface Holidays {
  version: number;
  features: {
    properties: { number: number; area_m2: number; lat_deg: number; lon_deg: number };
    geometry: { coordinates: LngLat[][][] };
  }[];
}

/** Where a vehicle was and when, as the tracks' GeoJSON says. */
export interface TimedTracks {
  features: {
    properties: { vehicle: string; depths_m: number[]; times: string[] };
    geometry: { coordinates: LngLat[] };
  }[];
}
