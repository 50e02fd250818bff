"""The operations of the service's REST interface.

Written by ``python -m app.client`` from the service's OpenAPI document: changed there, not here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Literal, TypeVar

from bathyfleet.client import models
from bathyfleet.client.call import Call, part

T = TypeVar("T")


class Operations(ABC):
    """Every operation of the service as a method that returns its answer."""

    @abstractmethod
    def _call(self, call: Call[T]) -> T:
        """Make a request and return its answer."""

    def create_mission(self, body: models.MissionSpec | Mapping[str, Any]) -> models.MissionView:
        """Describe a new mission: ``POST /missions``."""
        return self._call(Call[models.MissionView]("POST", "/missions", models.MissionView, body=body))

    def list_missions(self, *, before: str | None = None, limit: int | None = None) -> list[models.MissionSummary]:
        """List the missions: ``GET /missions``.

        Parameters
        ----------
        before : str
            Only missions older than that of this id
        limit : int, 1 to 1000
            Most missions in the answer; all of them unless given
        """
        return self._call(Call[list[models.MissionSummary]](
            "GET",
            "/missions",
            list[models.MissionSummary],
            query={"before": before, "limit": limit},
        ))

    def get_mission(self, mission_id: str) -> models.MissionView:
        """See a mission: ``GET /missions/{mission_id}``."""
        return self._call(Call[models.MissionView]("GET", f"/missions/{part(mission_id)}", models.MissionView))

    def describe_mission(self, mission_id: str, body: models.MissionSpec | Mapping[str, Any]) -> models.MissionView:
        """Describe a mission anew that has not started: ``PUT /missions/{mission_id}``."""
        return self._call(Call[models.MissionView](
            "PUT",
            f"/missions/{part(mission_id)}",
            models.MissionView,
            body=body,
        ))

    def delete_mission(self, mission_id: str) -> None:
        """Delete a mission that was not flown: ``DELETE /missions/{mission_id}``."""
        return self._call(Call[None]("DELETE", f"/missions/{part(mission_id)}", None))

    def set_budget(self, mission_id: str, body: models.Budget | Mapping[str, Any]) -> models.MissionView:
        """Change how long a mission is: ``PUT /missions/{mission_id}/budget``."""
        return self._call(Call[models.MissionView](
            "PUT",
            f"/missions/{part(mission_id)}/budget",
            models.MissionView,
            body=body,
        ))

    def start_mission(
        self,
        mission_id: str,
        body: models.StartRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Start a mission: ``POST /missions/{mission_id}/start``."""
        return self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/start",
            models.ActionView,
            body=body,
        ))

    def pause_mission(
        self,
        mission_id: str,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Pause a mission: ``POST /missions/{mission_id}/pause``."""
        return self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/pause",
            models.ActionView,
            body=body,
        ))

    def resume_mission(
        self,
        mission_id: str,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Resume a paused mission: ``POST /missions/{mission_id}/resume``."""
        return self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/resume",
            models.ActionView,
            body=body,
        ))

    def abort_mission(
        self,
        mission_id: str,
        body: models.EndRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Abort a mission: ``POST /missions/{mission_id}/abort``."""
        return self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/abort",
            models.ActionView,
            body=body,
        ))

    def finish_mission(
        self,
        mission_id: str,
        body: models.EndRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Finish a mission early: ``POST /missions/{mission_id}/finish``."""
        return self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/finish",
            models.ActionView,
            body=body,
        ))

    def check_mission(self, mission_id: str) -> models.PreflightView:
        """See what stands before the start: ``GET /missions/{mission_id}/preflight``."""
        return self._call(Call[models.PreflightView](
            "GET",
            f"/missions/{part(mission_id)}/preflight",
            models.PreflightView,
        ))

    def list_steps(
        self,
        mission_id: str,
        *,
        after: int | None = None,
        limit: int | None = None,
    ) -> list[models.StepView]:
        """See what was decided: ``GET /missions/{mission_id}/steps``.

        Parameters
        ----------
        after : int, default 0
            Only steps with a larger number
        limit : int, 1 to 1000, default 1000
            Most steps in the answer
        """
        return self._call(Call[list[models.StepView]](
            "GET",
            f"/missions/{part(mission_id)}/steps",
            list[models.StepView],
            query={"after": after, "limit": limit},
        ))

    def get_telemetry(self, mission_id: str, *, points: int | None = None) -> models.TelemetryView:
        """See the vehicles' figures over time: ``GET /missions/{mission_id}/telemetry``.

        Parameters
        ----------
        points : int, 2 to 5000, default 720
            Most moments in the answer, evenly spread
        """
        return self._call(Call[models.TelemetryView](
            "GET",
            f"/missions/{part(mission_id)}/telemetry",
            models.TelemetryView,
            query={"points": points},
        ))

    def write_note(self, mission_id: str, body: models.NoteRequest | Mapping[str, Any]) -> models.EventView:
        """Write into the log: ``POST /missions/{mission_id}/notes``."""
        return self._call(Call[models.EventView](
            "POST",
            f"/missions/{part(mission_id)}/notes",
            models.EventView,
            body=body,
        ))

    def abort_vehicle(self, mission_id: str, name: str) -> models.ActionView:
        """Stop one vehicle: ``POST /missions/{mission_id}/vehicles/{name}/abort``."""
        return self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/abort",
            models.ActionView,
        ))

    def return_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Send one vehicle home: ``POST /missions/{mission_id}/vehicles/{name}/return``."""
        return self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/return",
            models.MissionView,
        ))

    def hold_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Keep one vehicle where it is: ``POST /missions/{mission_id}/vehicles/{name}/hold``."""
        return self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/hold",
            models.MissionView,
        ))

    def resume_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Let a vehicle survey again: ``POST /missions/{mission_id}/vehicles/{name}/resume``."""
        return self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/resume",
            models.MissionView,
        ))

    def add_vehicle(self, mission_id: str, body: models.VehicleSpec | Mapping[str, Any]) -> models.MissionView:
        """Add a vehicle to a mission: ``POST /missions/{mission_id}/vehicles``."""
        return self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles",
            models.MissionView,
            body=body,
        ))

    def rejoin_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Take back a vehicle that left: ``POST /missions/{mission_id}/vehicles/{name}/rejoin``."""
        return self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/rejoin",
            models.MissionView,
        ))

    def remove_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Take a vehicle out of a mission: ``DELETE /missions/{mission_id}/vehicles/{name}``."""
        return self._call(Call[models.MissionView](
            "DELETE",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}",
            models.MissionView,
        ))

    def list_sites(self) -> list[models.SiteView]:
        """List the sites: ``GET /sites``."""
        return self._call(Call[list[models.SiteView]]("GET", "/sites", list[models.SiteView]))

    def create_site(self, body: models.SiteSpec | Mapping[str, Any]) -> models.SiteView:
        """Describe a site: ``POST /sites``."""
        return self._call(Call[models.SiteView]("POST", "/sites", models.SiteView, body=body))

    def get_site(self, site_id: str) -> models.SiteView:
        """See a site: ``GET /sites/{site_id}``."""
        return self._call(Call[models.SiteView]("GET", f"/sites/{part(site_id)}", models.SiteView))

    def change_site(self, site_id: str, body: models.SiteChanges | Mapping[str, Any]) -> models.SiteView:
        """Change a site: ``PATCH /sites/{site_id}``."""
        return self._call(Call[models.SiteView]("PATCH", f"/sites/{part(site_id)}", models.SiteView, body=body))

    def delete_site(self, site_id: str) -> None:
        """Delete a site without surveys: ``DELETE /sites/{site_id}``."""
        return self._call(Call[None]("DELETE", f"/sites/{part(site_id)}", None))

    def list_surveys(self, site_id: str) -> list[models.SurveyView]:
        """List a site's surveys: ``GET /sites/{site_id}/surveys``."""
        return self._call(Call[list[models.SurveyView]](
            "GET",
            f"/sites/{part(site_id)}/surveys",
            list[models.SurveyView],
        ))

    def get_site_map(self, site_id: str) -> models.SiteMapView:
        """See a site's map: ``GET /sites/{site_id}/map``."""
        return self._call(Call[models.SiteMapView]("GET", f"/sites/{part(site_id)}/map", models.SiteMapView))

    def get_changes(
        self,
        site_id: str,
        *,
        from_: str | None = None,
        to: str | None = None,
        confidence: float | None = None,
    ) -> models.ChangesView:
        """See what changed between two surveys: ``GET /sites/{site_id}/changes``.

        Parameters
        ----------
        from_ : str
            Mission of the earlier survey; default: the one before the other, below its datum
        to : str
            Mission of the later survey; default: the newest that can be compared
        confidence : float, default 0.95
            Of unchanged ground this share is not called changed
        """
        return self._call(Call[models.ChangesView](
            "GET",
            f"/sites/{part(site_id)}/changes",
            models.ChangesView,
            query={"from": from_, "to": to, "confidence": confidence},
        ))

    def get_site_map_file(self, site_id: str, format: str, *, crs: str | None = None) -> bytes:
        """Download a site's map: ``GET /sites/{site_id}/map.{format}``.

        Parameters
        ----------
        crs : str
            System of positions in `.tif`, `.xyz` and `.dxf`, in metres: `utm`, the zone of the site's middle, or
            `EPSG:nnnn`; default: the site's own frame
        """
        return self._call(Call[bytes]("GET", f"/sites/{part(site_id)}/map.{part(format)}", bytes, query={"crs": crs}))

    def get_changes_file(
        self,
        site_id: str,
        format: str,
        *,
        from_: str | None = None,
        to: str | None = None,
        confidence: float | None = None,
    ) -> bytes:
        """Download what changed between two surveys: ``GET /sites/{site_id}/changes.{format}``.

        Parameters
        ----------
        from_ : str
            Mission of the earlier survey; default: the one before the other, below its datum
        to : str
            Mission of the later survey; default: the newest that can be compared
        confidence : float, default 0.95
            Of unchanged ground this share is not called changed
        """
        return self._call(Call[bytes](
            "GET",
            f"/sites/{part(site_id)}/changes.{part(format)}",
            bytes,
            query={"from": from_, "to": to, "confidence": confidence},
        ))

    def set_site(self, mission_id: str, body: models.SiteChoice | Mapping[str, Any]) -> models.MissionView:
        """Put a mission into a site: ``PUT /missions/{mission_id}/site``."""
        return self._call(Call[models.MissionView](
            "PUT",
            f"/missions/{part(mission_id)}/site",
            models.MissionView,
            body=body,
        ))

    def forecast_mission(self, mission_id: str, *, floor_depth_m: float | None = None) -> models.ForecastView:
        """Foretell a mission: ``POST /missions/{mission_id}/forecast``.

        Parameters
        ----------
        floor_depth_m : float, at most 11000
            How deep it is where nothing is known; default: a guess
        """
        return self._call(Call[models.ForecastView](
            "POST",
            f"/missions/{part(mission_id)}/forecast",
            models.ForecastView,
            query={"floor_depth_m": floor_depth_m},
        ))

    def forecast_description(
        self,
        body: models.MissionSpec | Mapping[str, Any],
        *,
        floor_depth_m: float | None = None,
    ) -> models.ForecastView:
        """Foretell a mission that is being described: ``POST /forecast``.

        Parameters
        ----------
        floor_depth_m : float, at most 11000
            How deep it is where nothing is known; default: a guess
        """
        return self._call(Call[models.ForecastView](
            "POST",
            "/forecast",
            models.ForecastView,
            body=body,
            query={"floor_depth_m": floor_depth_m},
        ))

    def preview_plan(
        self,
        body: models.MissionSpec | Mapping[str, Any],
        *,
        floor_depth_m: float | None = None,
    ) -> models.PlanView:
        """Plan a mission that is being described: ``POST /plan``.

        Parameters
        ----------
        floor_depth_m : float, at most 11000
            How deep it is where nothing is known; default: a guess
        """
        return self._call(Call[models.PlanView](
            "POST",
            "/plan",
            models.PlanView,
            body=body,
            query={"floor_depth_m": floor_depth_m},
        ))

    def post_measurements(
        self,
        mission_id: str,
        body: models.MeasurementBatch | Mapping[str, Any],
        *,
        idempotency_key: str | None = None,
    ) -> models.BatchVerdict:
        """Post measurements: ``POST /missions/{mission_id}/measurements``.

        Parameters
        ----------
        idempotency_key : str
            Name of this batch, made by the sender. Sent again by the same sender with the same key and content,
            nothing is stored twice and the first answer is given again
        """
        return self._call(Call[models.BatchVerdict](
            "POST",
            f"/missions/{part(mission_id)}/measurements",
            models.BatchVerdict,
            body=body,
            headers={"idempotency-key": idempotency_key},
        ))

    def get_waypoint(
        self,
        mission_id: str,
        name: str,
        *,
        after_step: int | None = None,
        timeout_s: float | None = None,
    ) -> models.WaypointView | None:
        """Fetch a vehicle's waypoint: ``GET /missions/{mission_id}/vehicles/{name}/waypoint``.

        Parameters
        ----------
        after_step : int
            Step of the newest waypoint that the vehicle has: only a newer one is sent
        timeout_s : float, 0 to 60.0, default 25.0
            How long to wait for one, wall-clock seconds
        """
        return self._call(Call[models.WaypointView | None](
            "GET",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/waypoint",
            models.WaypointView,
            query={"after_step": after_step, "timeout_s": timeout_s},
        ))

    def get_corrections(self, mission_id: str) -> models.CorrectionsView:
        """See how soundings are corrected: ``GET /missions/{mission_id}/corrections``."""
        return self._call(Call[models.CorrectionsView](
            "GET",
            f"/missions/{part(mission_id)}/corrections",
            models.CorrectionsView,
        ))

    def set_tide(self, mission_id: str, body: models.TideCorrection | Mapping[str, Any]) -> models.CorrectionsView:
        """Correct the tide: ``PUT /missions/{mission_id}/tide``."""
        return self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/tide",
            models.CorrectionsView,
            body=body,
        ))

    def set_sound_speed(self, mission_id: str, body: models.SoundSpeed | Mapping[str, Any]) -> models.CorrectionsView:
        """Correct the sound speed: ``PUT /missions/{mission_id}/sound-speed``."""
        return self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/sound-speed",
            models.CorrectionsView,
            body=body,
        ))

    def delete_sound_speed(self, mission_id: str) -> models.CorrectionsView:
        """Take the sonars' own ranges: ``DELETE /missions/{mission_id}/sound-speed``."""
        return self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/sound-speed",
            models.CorrectionsView,
        ))

    def get_casts(self, mission_id: str, *, order: models.Order | None = None) -> models.CastsView:
        """See what each cast corrects: ``GET /missions/{mission_id}/sound-speed/casts``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that differences between casts are compared with
        """
        return self._call(Call[models.CastsView](
            "GET",
            f"/missions/{part(mission_id)}/sound-speed/casts",
            models.CastsView,
            query={"order": order},
        ))

    def add_casts(self, mission_id: str, body: models.NewCasts | Mapping[str, Any]) -> models.CorrectionsView:
        """Add sound speed casts: ``POST /missions/{mission_id}/sound-speed/casts``."""
        return self._call(Call[models.CorrectionsView](
            "POST",
            f"/missions/{part(mission_id)}/sound-speed/casts",
            models.CorrectionsView,
            body=body,
        ))

    def get_measured_casts(
        self,
        mission_id: str,
        *,
        vehicle: str | None = None,
        from_s: float | None = None,
        until_s: float | None = None,
    ) -> list[models.VehicleCastView]:
        """See the sound speed casts that vehicles measured: ``GET /missions/{mission_id}/sound-speed/measured``.

        Parameters
        ----------
        vehicle : str
            Whose; default: of all
        from_s : float
            Of what was measured from then on
        until_s : float
            Of what was measured until then
        """
        return self._call(Call[list[models.VehicleCastView]](
            "GET",
            f"/missions/{part(mission_id)}/sound-speed/measured",
            list[models.VehicleCastView],
            query={"vehicle": vehicle, "from_s": from_s, "until_s": until_s},
        ))

    def set_cast(
        self,
        mission_id: str,
        name: str,
        body: models.CastDescription | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Add or replace a sound speed cast: ``PUT /missions/{mission_id}/sound-speed/casts/{name}``."""
        return self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/sound-speed/casts/{part(name)}",
            models.CorrectionsView,
            body=body,
        ))

    def delete_cast(self, mission_id: str, name: str) -> models.CorrectionsView:
        """Remove a sound speed cast: ``DELETE /missions/{mission_id}/sound-speed/casts/{name}``."""
        return self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/sound-speed/casts/{part(name)}",
            models.CorrectionsView,
        ))

    def set_cast_rule(self, mission_id: str, body: models.CastRules | Mapping[str, Any]) -> models.CorrectionsView:
        """Choose sound speed casts by a rule: ``PUT /missions/{mission_id}/sound-speed/rule``."""
        return self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/sound-speed/rule",
            models.CorrectionsView,
            body=body,
        ))

    def set_mounting(
        self,
        mission_id: str,
        name: str,
        body: models.MountingSpec | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Correct how a sonar is mounted: ``PUT /missions/{mission_id}/mountings/{name}``."""
        return self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/mountings/{part(name)}",
            models.CorrectionsView,
            body=body,
        ))

    def delete_mounting(self, mission_id: str, name: str) -> models.CorrectionsView:
        """Take a sonar as its vehicle states it is mounted: ``DELETE /missions/{mission_id}/mountings/{name}``."""
        return self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/mountings/{part(name)}",
            models.CorrectionsView,
        ))

    def estimate_mounting(
        self,
        mission_id: str,
        name: str,
        body: models.MountingEstimateRequest | Mapping[str, Any] | None = None,
    ) -> models.MountingEstimateView:
        """Estimate how a sonar is mounted: ``POST /missions/{mission_id}/mountings/{name}/estimate``."""
        return self._call(Call[models.MountingEstimateView](
            "POST",
            f"/missions/{part(mission_id)}/mountings/{part(name)}/estimate",
            models.MountingEstimateView,
            body=body,
        ))

    def get_systematic_errors(self, mission_id: str) -> models.SystematicErrorsView:
        """See what is always wrong: ``GET /missions/{mission_id}/systematic-errors``."""
        return self._call(Call[models.SystematicErrorsView](
            "GET",
            f"/missions/{part(mission_id)}/systematic-errors",
            models.SystematicErrorsView,
        ))

    def set_systematic_errors(
        self,
        mission_id: str,
        body: models.SystematicErrors | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Take out what is always wrong: ``PUT /missions/{mission_id}/systematic-errors``."""
        return self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/systematic-errors",
            models.CorrectionsView,
            body=body,
        ))

    def delete_systematic_errors(self, mission_id: str) -> models.CorrectionsView:
        """Take nothing out: ``DELETE /missions/{mission_id}/systematic-errors``."""
        return self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/systematic-errors",
            models.CorrectionsView,
        ))

    def get_adjustment(self, mission_id: str) -> models.AdjustmentView:
        """See how tracks are adjusted: ``GET /missions/{mission_id}/adjustment``."""
        return self._call(Call[models.AdjustmentView](
            "GET",
            f"/missions/{part(mission_id)}/adjustment",
            models.AdjustmentView,
        ))

    def adjust_tracks(
        self,
        mission_id: str,
        body: models.AdjustmentRequest | Mapping[str, Any] | None = None,
    ) -> models.AdjustmentView:
        """Adjust tracks for drift: ``POST /missions/{mission_id}/adjustment``."""
        return self._call(Call[models.AdjustmentView](
            "POST",
            f"/missions/{part(mission_id)}/adjustment",
            models.AdjustmentView,
            body=body,
        ))

    def undo_adjustment(self, mission_id: str) -> models.AdjustmentView:
        """Take positions as they came: ``DELETE /missions/{mission_id}/adjustment``."""
        return self._call(Call[models.AdjustmentView](
            "DELETE",
            f"/missions/{part(mission_id)}/adjustment",
            models.AdjustmentView,
        ))

    def import_soundings(
        self,
        mission_id: str,
        content: bytes,
        *,
        filename: str,
        source: str | None = None,
        crs: str | None = None,
        positive: Literal["down", "up"] | None = None,
        sd_m: float | None = None,
        order: models.Order | None = None,
        datum_offset_m: float | None = None,
    ) -> models.ImportView:
        """Begin with soundings or a map from elsewhere: ``POST /missions/{mission_id}/imports``.

        Parameters
        ----------
        filename : str
            Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc, .bag, .h5
            (S-102), .000 (ENC cell), .gsf or .kmall (multibeam sonars)
        source : str
            Where it comes from, kept with the mission
        crs : str
            What positions are in where the file does not say: EPSG:4326, EPSG:32629, WKT, or local for the
            mission's own frame
        positive : Literal["down", "up"]
            Which way values grow: down for depths, up for heights; default: what the file says
        sd_m : float, at most 1000
            Standard deviation of the depths that state none, metres
        order : models.Order
            In place of sd_m: the S-44 order surveyed to; its largest TVU is assumed
        datum_offset_m : float, -200 to 200
            Added to every depth to bring it to the mission's datum, 0 where that is the file's; has to be said
            where the file states another one
        """
        return self._call(Call[models.ImportView](
            "POST",
            f"/missions/{part(mission_id)}/imports",
            models.ImportView,
            content=content,
            query={"filename": filename, "source": source, "crs": crs, "positive": positive, "sd_m": sd_m, "order": order, "datum_offset_m": datum_offset_m},
        ))

    def list_imports(self, mission_id: str) -> list[models.ImportView]:
        """List what was imported: ``GET /missions/{mission_id}/imports``."""
        return self._call(Call[list[models.ImportView]](
            "GET",
            f"/missions/{part(mission_id)}/imports",
            list[models.ImportView],
        ))

    def delete_import(self, mission_id: str, import_id: str) -> None:
        """Take an import back: ``DELETE /missions/{mission_id}/imports/{import_id}``."""
        return self._call(Call[None]("DELETE", f"/missions/{part(mission_id)}/imports/{part(import_id)}", None))

    def import_log(
        self,
        mission_id: str,
        content: bytes,
        *,
        filename: str,
        vehicle: str | None = None,
    ) -> models.LogView:
        """Import a vehicle's own log: ``POST /missions/{mission_id}/logs``.

        Parameters
        ----------
        filename : str
            Its name; .gsf and .kmall are files of a multibeam, everything else is read as a log of DUNE
            (Data.lsf, Data.lsf.gz)
        vehicle : str
            Name of the vehicle; default: the one that the log announces, which a multibeam's file does not
        """
        return self._call(Call[models.LogView](
            "POST",
            f"/missions/{part(mission_id)}/logs",
            models.LogView,
            content=content,
            query={"filename": filename, "vehicle": vehicle},
        ))

    def list_logs(self, mission_id: str) -> list[models.LogView]:
        """List the logs that were imported: ``GET /missions/{mission_id}/logs``."""
        return self._call(Call[list[models.LogView]]("GET", f"/missions/{part(mission_id)}/logs", list[models.LogView]))

    def get_log(self, mission_id: str, import_id: str) -> models.LogView:
        """See what came of a log, or how far it is: ``GET /missions/{mission_id}/logs/{import_id}``."""
        return self._call(Call[models.LogView](
            "GET",
            f"/missions/{part(mission_id)}/logs/{part(import_id)}",
            models.LogView,
        ))

    def delete_log(self, mission_id: str, import_id: str) -> models.LogView:
        """Stop reading a log, or take it back: ``DELETE /missions/{mission_id}/logs/{import_id}``."""
        return self._call(Call[models.LogView](
            "DELETE",
            f"/missions/{part(mission_id)}/logs/{part(import_id)}",
            models.LogView,
        ))

    def set_reference(
        self,
        mission_id: str,
        content: bytes,
        *,
        filename: str,
        source: str | None = None,
        crs: str | None = None,
        positive: Literal["down", "up"] | None = None,
        sd_m: float | None = None,
        order: models.Order | None = None,
        datum_offset_m: float | None = None,
    ) -> models.ReferenceView:
        """Compare the map with a grid: ``PUT /missions/{mission_id}/reference``.

        Parameters
        ----------
        filename : str
            Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc, .bag, .h5
            (S-102), .000 (ENC cell), .gsf or .kmall (multibeam sonars)
        source : str
            Where it comes from, kept with the mission
        crs : str
            What positions are in where the file does not say: EPSG:4326, EPSG:32629, WKT, or local for the
            mission's own frame
        positive : Literal["down", "up"]
            Which way values grow: down for depths, up for heights; default: what the file says
        sd_m : float, at most 1000
            Standard deviation of the depths that state none, metres
        order : models.Order
            In place of sd_m: the S-44 order surveyed to; its largest TVU is assumed
        datum_offset_m : float, -200 to 200
            Added to every depth to bring it to the mission's datum, 0 where that is the file's; has to be said
            where the file states another one
        """
        return self._call(Call[models.ReferenceView](
            "PUT",
            f"/missions/{part(mission_id)}/reference",
            models.ReferenceView,
            content=content,
            query={"filename": filename, "source": source, "crs": crs, "positive": positive, "sd_m": sd_m, "order": order, "datum_offset_m": datum_offset_m},
        ))

    def get_reference(self, mission_id: str) -> models.ReferenceView:
        """See what the map is compared with: ``GET /missions/{mission_id}/reference``."""
        return self._call(Call[models.ReferenceView](
            "GET",
            f"/missions/{part(mission_id)}/reference",
            models.ReferenceView,
        ))

    def delete_reference(self, mission_id: str) -> None:
        """Compare the map with nothing: ``DELETE /missions/{mission_id}/reference``."""
        return self._call(Call[None]("DELETE", f"/missions/{part(mission_id)}/reference", None))

    def propose_zones(
        self,
        content: bytes,
        *,
        west_deg: float,
        south_deg: float,
        east_deg: float,
        north_deg: float,
        margin_m: float | None = None,
    ) -> models.ProposedZonesView:
        """Propose keep-out zones from a chart: ``POST /chart-zones``.

        Parameters
        ----------
        west_deg : float, -180 to 180
            Western end of the area
        south_deg : float, -90 to 90
            Southern end of the area
        east_deg : float, -180 to 180
            Eastern end of the area
        north_deg : float, -90 to 90
            Northern end of the area
        margin_m : float, 0 to 1000, default 10.0
            How much all of it is enlarged, beside how well its place is known
        """
        return self._call(Call[models.ProposedZonesView](
            "POST",
            "/chart-zones",
            models.ProposedZonesView,
            content=content,
            query={"west_deg": west_deg, "south_deg": south_deg, "east_deg": east_deg, "north_deg": north_deg, "margin_m": margin_m},
        ))

    def read_drawing(
        self,
        content: bytes,
        *,
        filename: str,
        crs: str | None = None,
        margin_m: float | None = None,
    ) -> models.DrawingView:
        """Read the lines and areas of a file: ``POST /drawings``.

        Parameters
        ----------
        filename : str
            Its name; the ending says what it is: .geojson, .json, .kml, .kmz, .gpx, .dxf, .zip (a shapefile),
            .csv or .txt (name and position in each row), or .lnw (Hypack)
        crs : str
            What positions are in where the file does not say: EPSG:32629, EPSG:4326 or WKT
        margin_m : float, 1 to 2000, default 50.0
            How far the area around the lines reaches beyond them
        """
        return self._call(Call[models.DrawingView](
            "POST",
            "/drawings",
            models.DrawingView,
            content=content,
            query={"filename": filename, "crs": crs, "margin_m": margin_m},
        ))

    def get_map(
        self,
        mission_id: str,
        *,
        layer: list[models.LayerName] | None = None,
        order: models.Order | None = None,
    ) -> models.MapView:
        """See the map: ``GET /missions/{mission_id}/map``.

        Parameters
        ----------
        layer : list[models.LayerName]
            Further layers, in `layers`; repeat it for several
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return self._call(Call[models.MapView](
            "GET",
            f"/missions/{part(mission_id)}/map",
            models.MapView,
            query={"layer": layer, "order": order},
        ))

    def get_map_overlay(
        self,
        mission_id: str,
        *,
        layer: models.OverlayLayer | None = None,
        order: models.Order | None = None,
        min: float | None = None,
        max: float | None = None,
    ) -> bytes:
        """See the map as a transparent picture: ``GET /missions/{mission_id}/map.overlay.png``.

        Parameters
        ----------
        layer : models.OverlayLayer, default depth
            What is shown
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        min : float, -20000.0 to 20000.0
            Value at the palette's begin, m; default: the map's least
        max : float, -20000.0 to 20000.0
            Value at the palette's end, m; default: the map's largest
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/map.overlay.png",
            bytes,
            query={"layer": layer, "order": order, "min": min, "max": max},
        ))

    def get_map_tiles(
        self,
        mission_id: str,
        *,
        since: str | None = None,
        layer: list[models.FurtherLayer] | None = None,
        step: int | None = None,
    ) -> bytes:
        """Follow the map: ``GET /missions/{mission_id}/map/tiles``.

        Parameters
        ----------
        since : str
            `tag` of the map that the client has
        layer : list[models.FurtherLayer]
            Layers beside the usual ones
        step : int
            The map as it was at the end of this step; default: the newest
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/map/tiles",
            bytes,
            query={"since": since, "layer": layer, "step": step},
        ))

    def get_quality(self, mission_id: str) -> models.QualityView:
        """Judge the map: ``GET /missions/{mission_id}/quality``."""
        return self._call(Call[models.QualityView]("GET", f"/missions/{part(mission_id)}/quality", models.QualityView))

    def get_uncertainty_budget(self, mission_id: str) -> models.UncertaintyBudgetView:
        """See where uncertainty comes from: ``GET /missions/{mission_id}/uncertainty-budget``."""
        return self._call(Call[models.UncertaintyBudgetView](
            "GET",
            f"/missions/{part(mission_id)}/uncertainty-budget",
            models.UncertaintyBudgetView,
        ))

    def get_holidays(self, mission_id: str) -> dict[str, Any]:
        """See what swath sonars missed: ``GET /missions/{mission_id}/holidays``."""
        return self._call(Call[dict[str, Any]]("GET", f"/missions/{part(mission_id)}/holidays", dict[str, Any]))

    def get_crosslines(self, mission_id: str, *, order: models.Order | None = None) -> models.CrossoversView:
        """See how well the survey agrees with itself: ``GET /missions/{mission_id}/crosslines``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return self._call(Call[models.CrossoversView](
            "GET",
            f"/missions/{part(mission_id)}/crosslines",
            models.CrossoversView,
            query={"order": order},
        ))

    def get_crossovers_file(self, mission_id: str, *, order: models.Order | None = None) -> str:
        """Download the crossings: ``GET /missions/{mission_id}/crossovers.csv``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return self._call(Call[str]("GET", f"/missions/{part(mission_id)}/crossovers.csv", str, query={"order": order}))

    def list_products(self, mission_id: str) -> list[models.ProductView]:
        """List the files: ``GET /missions/{mission_id}/products``."""
        return self._call(Call[list[models.ProductView]](
            "GET",
            f"/missions/{part(mission_id)}/products",
            list[models.ProductView],
        ))

    def get_holidays_file(self, mission_id: str) -> dict[str, Any]:
        """Download the holidays: ``GET /missions/{mission_id}/holidays.geojson``."""
        return self._call(Call[dict[str, Any]]("GET", f"/missions/{part(mission_id)}/holidays.geojson", dict[str, Any]))

    def get_pdf_report(
        self,
        mission_id: str,
        *,
        lang: models.Language | None = None,
        order: models.Order | None = None,
    ) -> bytes:
        """Download the survey's report as PDF: ``GET /missions/{mission_id}/report.pdf``.

        Parameters
        ----------
        lang : models.Language, default en
            Language that it is written in
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/report.pdf",
            bytes,
            query={"lang": lang, "order": order},
        ))

    def get_html_report(
        self,
        mission_id: str,
        *,
        lang: models.Language | None = None,
        order: models.Order | None = None,
    ) -> bytes:
        """Download the survey's report as HTML: ``GET /missions/{mission_id}/report.html``.

        Parameters
        ----------
        lang : models.Language, default en
            Language that it is written in
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/report.html",
            bytes,
            query={"lang": lang, "order": order},
        ))

    def get_map_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the map: ``GET /missions/{mission_id}/map.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/map.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    def get_contours_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the contours: ``GET /missions/{mission_id}/contours.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/contours.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    def get_soundings_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the soundings: ``GET /missions/{mission_id}/soundings.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/soundings.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    def get_tracks_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the tracks: ``GET /missions/{mission_id}/tracks.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/tracks.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    def get_lines_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the log of lines: ``GET /missions/{mission_id}/lines.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/lines.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    def get_profile(
        self,
        mission_id: str,
        *,
        line: str,
        spacing_m: float | None = None,
        within_m: float | None = None,
        layer: list[models.LayerName] | None = None,
        order: models.Order | None = None,
    ) -> models.ProfileView:
        """See the map along a line: ``GET /missions/{mission_id}/profile``.

        Parameters
        ----------
        line : str
            Its 2 to 100 corners as longitude,latitude, with ; between them
        spacing_m : float, at most 1000.0
            Between points; default: half a cell
        within_m : float, at most 1000.0
            From the line to soundings at most; default: one cell
        layer : list[models.LayerName]
            Further layers, in `layers`; repeat it for several
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return self._call(Call[models.ProfileView](
            "GET",
            f"/missions/{part(mission_id)}/profile",
            models.ProfileView,
            query={"line": line, "spacing_m": spacing_m, "within_m": within_m, "layer": layer, "order": order},
        ))

    def list_layers(self) -> list[models.LayerView]:
        """List the layers of maps: ``GET /layers``."""
        return self._call(Call[list[models.LayerView]]("GET", "/layers", list[models.LayerView]))

    def get_tile_json(
        self,
        mission_id: str,
        layer: str,
        *,
        min: float | None = None,
        max: float | None = None,
    ) -> models.TileJson:
        """See where a layer's tiles are: ``GET /missions/{mission_id}/tiles/{layer}.json``.

        Parameters
        ----------
        min : float, -20000.0 to 20000.0
            Value of the first colour; default: what the layer's TileJSON says
        max : float, -20000.0 to 20000.0
            Value of the last colour; default: what the layer's TileJSON says
        """
        return self._call(Call[models.TileJson](
            "GET",
            f"/missions/{part(mission_id)}/tiles/{part(layer)}.json",
            models.TileJson,
            query={"min": min, "max": max},
        ))

    def get_tile(
        self,
        mission_id: str,
        layer: str,
        z: int,
        x: int,
        y: str,
        *,
        min: float | None = None,
        max: float | None = None,
    ) -> bytes:
        """See the map as tiles: ``GET /missions/{mission_id}/tiles/{layer}/{z}/{x}/{y}.png``.

        Parameters
        ----------
        min : float, -20000.0 to 20000.0
            Value of the first colour; default: what the layer's TileJSON says
        max : float, -20000.0 to 20000.0
            Value of the last colour; default: what the layer's TileJSON says
        """
        return self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/tiles/{part(layer)}/{part(z)}/{part(x)}/{part(y)}.png",
            bytes,
            query={"min": min, "max": max},
        ))

    def list_soundings(
        self,
        mission_id: str,
        *,
        state: list[models.SoundingState] | None = None,
        vehicle: str | None = None,
        after: int | None = None,
        limit: int | None = None,
    ) -> models.SoundingPage:
        """See which soundings are not in the map, and why: ``GET /missions/{mission_id}/soundings``.

        Parameters
        ----------
        state : list[models.SoundingState]
            Only soundings in these states; default: all that are not simply used
        vehicle : str
            Only this vehicle's
        after : int, default 0
            Only soundings with a larger id
        limit : int, 1 to 1000, default 200
            Most soundings in the answer
        """
        return self._call(Call[models.SoundingPage](
            "GET",
            f"/missions/{part(mission_id)}/soundings",
            models.SoundingPage,
            query={"state": state, "vehicle": vehicle, "after": after, "limit": limit},
        ))

    def list_sounding_points(
        self,
        mission_id: str,
        *,
        after: int | None = None,
        limit: int | None = None,
    ) -> models.SoundingPoints:
        """See all soundings as points: ``GET /missions/{mission_id}/soundings/points``.

        Parameters
        ----------
        after : int, default 0
            Only soundings with a larger id
        limit : int, 1 to 20000, default 20000
            Most soundings in the answer
        """
        return self._call(Call[models.SoundingPoints](
            "GET",
            f"/missions/{part(mission_id)}/soundings/points",
            models.SoundingPoints,
            query={"after": after, "limit": limit},
        ))

    def restore_soundings(self, mission_id: str, body: models.RulingRequest | Mapping[str, Any]) -> models.RulingsView:
        """Let many soundings count: ``POST /missions/{mission_id}/soundings/restore``."""
        return self._call(Call[models.RulingsView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/restore",
            models.RulingsView,
            body=body,
        ))

    def reject_soundings(self, mission_id: str, body: models.RulingRequest | Mapping[str, Any]) -> models.RulingsView:
        """Keep many soundings out: ``POST /missions/{mission_id}/soundings/reject``."""
        return self._call(Call[models.RulingsView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/reject",
            models.RulingsView,
            body=body,
        ))

    def restore_sounding(
        self,
        mission_id: str,
        sounding_id: int,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.SoundingView:
        """Let a sounding count: ``POST /missions/{mission_id}/soundings/{sounding_id}/restore``."""
        return self._call(Call[models.SoundingView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/{part(sounding_id)}/restore",
            models.SoundingView,
            body=body,
        ))

    def reject_sounding(
        self,
        mission_id: str,
        sounding_id: int,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.SoundingView:
        """Keep a sounding out: ``POST /missions/{mission_id}/soundings/{sounding_id}/reject``."""
        return self._call(Call[models.SoundingView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/{part(sounding_id)}/reject",
            models.SoundingView,
            body=body,
        ))

    def list_pings(self, mission_id: str) -> models.PingsView:
        """See which pings there are: ``GET /missions/{mission_id}/pings``."""
        return self._call(Call[models.PingsView]("GET", f"/missions/{part(mission_id)}/pings", models.PingsView))

    def get_pings(self, mission_id: str, number: int) -> bytes:
        """Fetch a file of pings: ``GET /missions/{mission_id}/pings/{number}``."""
        return self._call(Call[bytes]("GET", f"/missions/{part(mission_id)}/pings/{part(number)}", bytes))

    def select_beams(self, mission_id: str, body: models.BeamPointsRequest | Mapping[str, Any]) -> models.BeamPoints:
        """See beams as points: ``POST /missions/{mission_id}/beams/points``."""
        return self._call(Call[models.BeamPoints](
            "POST",
            f"/missions/{part(mission_id)}/beams/points",
            models.BeamPoints,
            body=body,
        ))

    def reject_beams(self, mission_id: str, body: models.BeamRulingRequest | Mapping[str, Any]) -> models.BeamEditView:
        """Keep beams out: ``POST /missions/{mission_id}/beams/reject``."""
        return self._call(Call[models.BeamEditView](
            "POST",
            f"/missions/{part(mission_id)}/beams/reject",
            models.BeamEditView,
            body=body,
        ))

    def restore_beams(self, mission_id: str, body: models.BeamRulingRequest | Mapping[str, Any]) -> models.BeamEditView:
        """Let beams count: ``POST /missions/{mission_id}/beams/restore``."""
        return self._call(Call[models.BeamEditView](
            "POST",
            f"/missions/{part(mission_id)}/beams/restore",
            models.BeamEditView,
            body=body,
        ))

    def list_beam_edits(self, mission_id: str) -> models.BeamEditsView:
        """See what was said of beams: ``GET /missions/{mission_id}/beams/edits``."""
        return self._call(Call[models.BeamEditsView](
            "GET",
            f"/missions/{part(mission_id)}/beams/edits",
            models.BeamEditsView,
        ))

    def withdraw_beam_edit(self, mission_id: str, edit_id: int) -> models.BeamEditsView:
        """Take back what was said of beams: ``DELETE /missions/{mission_id}/beams/edits/{edit_id}``."""
        return self._call(Call[models.BeamEditsView](
            "DELETE",
            f"/missions/{part(mission_id)}/beams/edits/{part(edit_id)}",
            models.BeamEditsView,
        ))

    def list_targets(self, mission_id: str) -> list[models.TargetView]:
        """See what is known of a mission's moving targets: ``GET /missions/{mission_id}/targets``."""
        return self._call(Call[list[models.TargetView]](
            "GET",
            f"/missions/{part(mission_id)}/targets",
            list[models.TargetView],
        ))

    def list_target_ranges(
        self,
        mission_id: str,
        *,
        target: str | None = None,
        after: int | None = None,
        limit: int | None = None,
    ) -> models.TargetRangePage:
        """See the ranges to targets, and which were used: ``GET /missions/{mission_id}/targets/ranges``.

        Parameters
        ----------
        target : str
            Only ranges to this target
        after : int, default 0
            Only ranges with a larger id
        limit : int, 1 to 1000, default 200
            Most ranges in the answer
        """
        return self._call(Call[models.TargetRangePage](
            "GET",
            f"/missions/{part(mission_id)}/targets/ranges",
            models.TargetRangePage,
            query={"target": target, "after": after, "limit": limit},
        ))

    def post_scans(self, mission_id: str, body: models.ScanBatch | Mapping[str, Any]) -> models.BatchVerdict:
        """Post scans: ``POST /missions/{mission_id}/scans``."""
        return self._call(Call[models.BatchVerdict](
            "POST",
            f"/missions/{part(mission_id)}/scans",
            models.BatchVerdict,
            body=body,
        ))

    def get_search(self, mission_id: str, *, after: int | None = None) -> models.SearchGridView | None:
        """See the site of a search as known now: ``GET /missions/{mission_id}/search``.

        Parameters
        ----------
        after : int
            Only what is newer than this version
        """
        return self._call(Call[models.SearchGridView | None](
            "GET",
            f"/missions/{part(mission_id)}/search",
            models.SearchGridView,
            query={"after": after},
        ))

    def get_search_obstacles(self, mission_id: str) -> dict[str, Any]:
        """Download the obstacles of a search as GeoJSON: ``GET /missions/{mission_id}/search/obstacles.geojson``."""
        return self._call(Call[dict[str, Any]](
            "GET",
            f"/missions/{part(mission_id)}/search/obstacles.geojson",
            dict[str, Any],
        ))

    def get_events(
        self,
        mission_id: str,
        *,
        after: int | None = None,
        limit: int | None = None,
    ) -> list[models.EventView]:
        """Follow or read a mission's log: ``GET /missions/{mission_id}/events``.

        Parameters
        ----------
        after : int, default 0
            Only entries with a larger id, like `Last-Event-ID`, which is stronger
        limit : int, 1 to 1000, default 1000
            Most entries in a list
        """
        return self._call(Call[list[models.EventView]](
            "GET",
            f"/missions/{part(mission_id)}/events",
            list[models.EventView],
            query={"after": after, "limit": limit},
        ))

    def list_vehicles(self) -> list[models.VehicleView]:
        """List the vehicles: ``GET /vehicles``."""
        return self._call(Call[list[models.VehicleView]]("GET", "/vehicles", list[models.VehicleView]))

    def examine_links(self) -> models.DoctorView:
        """Say what is missing: ``GET /doctor``."""
        return self._call(Call[models.DoctorView]("GET", "/doctor", models.DoctorView))

    def list_ships(self) -> models.TrafficView:
        """List the ships about: ``GET /traffic``."""
        return self._call(Call[models.TrafficView]("GET", "/traffic", models.TrafficView))

    def list_planners(self) -> list[models.PlannerView]:
        """List the planners: ``GET /planners``."""
        return self._call(Call[list[models.PlannerView]]("GET", "/planners", list[models.PlannerView]))

    def list_orders(self, mission_id: str) -> list[models.OrderView]:
        """See what vehicles were ordered: ``GET /missions/{mission_id}/orders``."""
        return self._call(Call[list[models.OrderView]](
            "GET",
            f"/missions/{part(mission_id)}/orders",
            list[models.OrderView],
        ))

    def go_vehicle(self, mission_id: str, name: str, body: models.GoOrder | Mapping[str, Any]) -> models.OrderView:
        """Send one vehicle to a place now: ``POST /missions/{mission_id}/vehicles/{name}/go``."""
        return self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/go",
            models.OrderView,
            body=body,
        ))

    def skip_line(self, mission_id: str, name: str) -> models.OrderView:
        """Leave out the rest of a vehicle's line: ``POST /missions/{mission_id}/vehicles/{name}/skip-line``."""
        return self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/skip-line",
            models.OrderView,
        ))

    def repeat_line(
        self,
        mission_id: str,
        name: str,
        body: models.RepeatOrder | Mapping[str, Any] | None = None,
    ) -> models.OrderView:
        """Let a vehicle fly a line again: ``POST /missions/{mission_id}/vehicles/{name}/repeat-line``."""
        return self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/repeat-line",
            models.OrderView,
            body=body,
        ))

    def survey_denser(self, mission_id: str, body: models.DenserOrder | Mapping[str, Any]) -> models.OrderView:
        """Survey a part of the area denser: ``POST /missions/{mission_id}/denser``."""
        return self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/denser",
            models.OrderView,
            body=body,
        ))

    def list_alarms(
        self,
        *,
        state: models.AlarmState | None = None,
        mission: str | None = None,
        limit: int | None = None,
    ) -> list[models.AlarmReport]:
        """List alarms: ``GET /alarms``.

        Parameters
        ----------
        state : models.AlarmState
            Only these; left out: all
        mission : str
            Only those of the mission with this id
        limit : int, 1 to 1000, default 200
            Most alarms in the answer
        """
        return self._call(Call[list[models.AlarmReport]](
            "GET",
            "/alarms",
            list[models.AlarmReport],
            query={"state": state, "mission": mission, "limit": limit},
        ))

    def test_alarm(self, body: models.AlarmTrial | Mapping[str, Any] | None = None) -> models.AlarmReport:
        """Try who is told: ``POST /alarms/test``."""
        return self._call(Call[models.AlarmReport]("POST", "/alarms/test", models.AlarmReport, body=body))

    def get_alarm(self, alarm_id: str) -> models.AlarmReport:
        """See an alarm: ``GET /alarms/{alarm_id}``."""
        return self._call(Call[models.AlarmReport]("GET", f"/alarms/{part(alarm_id)}", models.AlarmReport))

    def acknowledge_alarm(self, alarm_id: str) -> models.AlarmReport:
        """Take an alarm: ``POST /alarms/{alarm_id}/acknowledge``."""
        return self._call(Call[models.AlarmReport]("POST", f"/alarms/{part(alarm_id)}/acknowledge", models.AlarmReport))

    def list_audit(
        self,
        *,
        before: int | None = None,
        days: float | None = None,
        actor: str | None = None,
        mission: str | None = None,
        limit: int | None = None,
    ) -> list[models.AuditEntry]:
        """See who commanded what: ``GET /audit``.

        Parameters
        ----------
        before : int
            Only older entries than that of this id
        days : float, at most 36500
            Only entries of the last so many days
        actor : str
            Only of the token of this name
        mission : str
            Only to the mission of this id
        limit : int, 1 to 1000, default 100
            Most entries in the answer
        """
        return self._call(Call[list[models.AuditEntry]](
            "GET",
            "/audit",
            list[models.AuditEntry],
            query={"before": before, "days": days, "actor": actor, "mission": mission, "limit": limit},
        ))

    def get_session(self) -> models.SessionView:
        """See who you are: ``GET /session``."""
        return self._call(Call[models.SessionView]("GET", "/session", models.SessionView))

    def sign_in(self) -> models.SessionView:
        """Sign a browser in: ``POST /session``."""
        return self._call(Call[models.SessionView]("POST", "/session", models.SessionView))

    def sign_out(self) -> None:
        """Sign a browser out: ``DELETE /session``."""
        return self._call(Call[None]("DELETE", "/session", None))

    def get_health(self) -> models.ComponentHealth:
        """See the service's health: ``GET /health``."""
        return self._call(Call[models.ComponentHealth]("GET", "/health", models.ComponentHealth))

    def get_liveness(self) -> models.Liveness:
        """Is the process alive: ``GET /health/live``."""
        return self._call(Call[models.Liveness]("GET", "/health/live", models.Liveness))

    def get_readiness(self) -> models.ComponentHealth:
        """Can it do its work: ``GET /health/ready``."""
        return self._call(Call[models.ComponentHealth]("GET", "/health/ready", models.ComponentHealth))

    def get_metrics(self) -> str:
        """Measurements for Prometheus: ``GET /metrics``."""
        return self._call(Call[str]("GET", "/metrics", str))


class AsyncOperations(ABC):
    """Every operation of the service as a coroutine that returns its answer."""

    @abstractmethod
    async def _call(self, call: Call[T]) -> T:
        """Make a request and return its answer."""

    async def create_mission(self, body: models.MissionSpec | Mapping[str, Any]) -> models.MissionView:
        """Describe a new mission: ``POST /missions``."""
        return await self._call(Call[models.MissionView]("POST", "/missions", models.MissionView, body=body))

    async def list_missions(
        self,
        *,
        before: str | None = None,
        limit: int | None = None,
    ) -> list[models.MissionSummary]:
        """List the missions: ``GET /missions``.

        Parameters
        ----------
        before : str
            Only missions older than that of this id
        limit : int, 1 to 1000
            Most missions in the answer; all of them unless given
        """
        return await self._call(Call[list[models.MissionSummary]](
            "GET",
            "/missions",
            list[models.MissionSummary],
            query={"before": before, "limit": limit},
        ))

    async def get_mission(self, mission_id: str) -> models.MissionView:
        """See a mission: ``GET /missions/{mission_id}``."""
        return await self._call(Call[models.MissionView]("GET", f"/missions/{part(mission_id)}", models.MissionView))

    async def describe_mission(
        self,
        mission_id: str,
        body: models.MissionSpec | Mapping[str, Any],
    ) -> models.MissionView:
        """Describe a mission anew that has not started: ``PUT /missions/{mission_id}``."""
        return await self._call(Call[models.MissionView](
            "PUT",
            f"/missions/{part(mission_id)}",
            models.MissionView,
            body=body,
        ))

    async def delete_mission(self, mission_id: str) -> None:
        """Delete a mission that was not flown: ``DELETE /missions/{mission_id}``."""
        return await self._call(Call[None]("DELETE", f"/missions/{part(mission_id)}", None))

    async def set_budget(self, mission_id: str, body: models.Budget | Mapping[str, Any]) -> models.MissionView:
        """Change how long a mission is: ``PUT /missions/{mission_id}/budget``."""
        return await self._call(Call[models.MissionView](
            "PUT",
            f"/missions/{part(mission_id)}/budget",
            models.MissionView,
            body=body,
        ))

    async def start_mission(
        self,
        mission_id: str,
        body: models.StartRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Start a mission: ``POST /missions/{mission_id}/start``."""
        return await self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/start",
            models.ActionView,
            body=body,
        ))

    async def pause_mission(
        self,
        mission_id: str,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Pause a mission: ``POST /missions/{mission_id}/pause``."""
        return await self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/pause",
            models.ActionView,
            body=body,
        ))

    async def resume_mission(
        self,
        mission_id: str,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Resume a paused mission: ``POST /missions/{mission_id}/resume``."""
        return await self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/resume",
            models.ActionView,
            body=body,
        ))

    async def abort_mission(
        self,
        mission_id: str,
        body: models.EndRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Abort a mission: ``POST /missions/{mission_id}/abort``."""
        return await self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/abort",
            models.ActionView,
            body=body,
        ))

    async def finish_mission(
        self,
        mission_id: str,
        body: models.EndRequest | Mapping[str, Any] | None = None,
    ) -> models.ActionView:
        """Finish a mission early: ``POST /missions/{mission_id}/finish``."""
        return await self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/finish",
            models.ActionView,
            body=body,
        ))

    async def check_mission(self, mission_id: str) -> models.PreflightView:
        """See what stands before the start: ``GET /missions/{mission_id}/preflight``."""
        return await self._call(Call[models.PreflightView](
            "GET",
            f"/missions/{part(mission_id)}/preflight",
            models.PreflightView,
        ))

    async def list_steps(
        self,
        mission_id: str,
        *,
        after: int | None = None,
        limit: int | None = None,
    ) -> list[models.StepView]:
        """See what was decided: ``GET /missions/{mission_id}/steps``.

        Parameters
        ----------
        after : int, default 0
            Only steps with a larger number
        limit : int, 1 to 1000, default 1000
            Most steps in the answer
        """
        return await self._call(Call[list[models.StepView]](
            "GET",
            f"/missions/{part(mission_id)}/steps",
            list[models.StepView],
            query={"after": after, "limit": limit},
        ))

    async def get_telemetry(self, mission_id: str, *, points: int | None = None) -> models.TelemetryView:
        """See the vehicles' figures over time: ``GET /missions/{mission_id}/telemetry``.

        Parameters
        ----------
        points : int, 2 to 5000, default 720
            Most moments in the answer, evenly spread
        """
        return await self._call(Call[models.TelemetryView](
            "GET",
            f"/missions/{part(mission_id)}/telemetry",
            models.TelemetryView,
            query={"points": points},
        ))

    async def write_note(self, mission_id: str, body: models.NoteRequest | Mapping[str, Any]) -> models.EventView:
        """Write into the log: ``POST /missions/{mission_id}/notes``."""
        return await self._call(Call[models.EventView](
            "POST",
            f"/missions/{part(mission_id)}/notes",
            models.EventView,
            body=body,
        ))

    async def abort_vehicle(self, mission_id: str, name: str) -> models.ActionView:
        """Stop one vehicle: ``POST /missions/{mission_id}/vehicles/{name}/abort``."""
        return await self._call(Call[models.ActionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/abort",
            models.ActionView,
        ))

    async def return_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Send one vehicle home: ``POST /missions/{mission_id}/vehicles/{name}/return``."""
        return await self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/return",
            models.MissionView,
        ))

    async def hold_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Keep one vehicle where it is: ``POST /missions/{mission_id}/vehicles/{name}/hold``."""
        return await self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/hold",
            models.MissionView,
        ))

    async def resume_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Let a vehicle survey again: ``POST /missions/{mission_id}/vehicles/{name}/resume``."""
        return await self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/resume",
            models.MissionView,
        ))

    async def add_vehicle(self, mission_id: str, body: models.VehicleSpec | Mapping[str, Any]) -> models.MissionView:
        """Add a vehicle to a mission: ``POST /missions/{mission_id}/vehicles``."""
        return await self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles",
            models.MissionView,
            body=body,
        ))

    async def rejoin_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Take back a vehicle that left: ``POST /missions/{mission_id}/vehicles/{name}/rejoin``."""
        return await self._call(Call[models.MissionView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/rejoin",
            models.MissionView,
        ))

    async def remove_vehicle(self, mission_id: str, name: str) -> models.MissionView:
        """Take a vehicle out of a mission: ``DELETE /missions/{mission_id}/vehicles/{name}``."""
        return await self._call(Call[models.MissionView](
            "DELETE",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}",
            models.MissionView,
        ))

    async def list_sites(self) -> list[models.SiteView]:
        """List the sites: ``GET /sites``."""
        return await self._call(Call[list[models.SiteView]]("GET", "/sites", list[models.SiteView]))

    async def create_site(self, body: models.SiteSpec | Mapping[str, Any]) -> models.SiteView:
        """Describe a site: ``POST /sites``."""
        return await self._call(Call[models.SiteView]("POST", "/sites", models.SiteView, body=body))

    async def get_site(self, site_id: str) -> models.SiteView:
        """See a site: ``GET /sites/{site_id}``."""
        return await self._call(Call[models.SiteView]("GET", f"/sites/{part(site_id)}", models.SiteView))

    async def change_site(self, site_id: str, body: models.SiteChanges | Mapping[str, Any]) -> models.SiteView:
        """Change a site: ``PATCH /sites/{site_id}``."""
        return await self._call(Call[models.SiteView]("PATCH", f"/sites/{part(site_id)}", models.SiteView, body=body))

    async def delete_site(self, site_id: str) -> None:
        """Delete a site without surveys: ``DELETE /sites/{site_id}``."""
        return await self._call(Call[None]("DELETE", f"/sites/{part(site_id)}", None))

    async def list_surveys(self, site_id: str) -> list[models.SurveyView]:
        """List a site's surveys: ``GET /sites/{site_id}/surveys``."""
        return await self._call(Call[list[models.SurveyView]](
            "GET",
            f"/sites/{part(site_id)}/surveys",
            list[models.SurveyView],
        ))

    async def get_site_map(self, site_id: str) -> models.SiteMapView:
        """See a site's map: ``GET /sites/{site_id}/map``."""
        return await self._call(Call[models.SiteMapView]("GET", f"/sites/{part(site_id)}/map", models.SiteMapView))

    async def get_changes(
        self,
        site_id: str,
        *,
        from_: str | None = None,
        to: str | None = None,
        confidence: float | None = None,
    ) -> models.ChangesView:
        """See what changed between two surveys: ``GET /sites/{site_id}/changes``.

        Parameters
        ----------
        from_ : str
            Mission of the earlier survey; default: the one before the other, below its datum
        to : str
            Mission of the later survey; default: the newest that can be compared
        confidence : float, default 0.95
            Of unchanged ground this share is not called changed
        """
        return await self._call(Call[models.ChangesView](
            "GET",
            f"/sites/{part(site_id)}/changes",
            models.ChangesView,
            query={"from": from_, "to": to, "confidence": confidence},
        ))

    async def get_site_map_file(self, site_id: str, format: str, *, crs: str | None = None) -> bytes:
        """Download a site's map: ``GET /sites/{site_id}/map.{format}``.

        Parameters
        ----------
        crs : str
            System of positions in `.tif`, `.xyz` and `.dxf`, in metres: `utm`, the zone of the site's middle, or
            `EPSG:nnnn`; default: the site's own frame
        """
        return await self._call(Call[bytes](
            "GET",
            f"/sites/{part(site_id)}/map.{part(format)}",
            bytes,
            query={"crs": crs},
        ))

    async def get_changes_file(
        self,
        site_id: str,
        format: str,
        *,
        from_: str | None = None,
        to: str | None = None,
        confidence: float | None = None,
    ) -> bytes:
        """Download what changed between two surveys: ``GET /sites/{site_id}/changes.{format}``.

        Parameters
        ----------
        from_ : str
            Mission of the earlier survey; default: the one before the other, below its datum
        to : str
            Mission of the later survey; default: the newest that can be compared
        confidence : float, default 0.95
            Of unchanged ground this share is not called changed
        """
        return await self._call(Call[bytes](
            "GET",
            f"/sites/{part(site_id)}/changes.{part(format)}",
            bytes,
            query={"from": from_, "to": to, "confidence": confidence},
        ))

    async def set_site(self, mission_id: str, body: models.SiteChoice | Mapping[str, Any]) -> models.MissionView:
        """Put a mission into a site: ``PUT /missions/{mission_id}/site``."""
        return await self._call(Call[models.MissionView](
            "PUT",
            f"/missions/{part(mission_id)}/site",
            models.MissionView,
            body=body,
        ))

    async def forecast_mission(self, mission_id: str, *, floor_depth_m: float | None = None) -> models.ForecastView:
        """Foretell a mission: ``POST /missions/{mission_id}/forecast``.

        Parameters
        ----------
        floor_depth_m : float, at most 11000
            How deep it is where nothing is known; default: a guess
        """
        return await self._call(Call[models.ForecastView](
            "POST",
            f"/missions/{part(mission_id)}/forecast",
            models.ForecastView,
            query={"floor_depth_m": floor_depth_m},
        ))

    async def forecast_description(
        self,
        body: models.MissionSpec | Mapping[str, Any],
        *,
        floor_depth_m: float | None = None,
    ) -> models.ForecastView:
        """Foretell a mission that is being described: ``POST /forecast``.

        Parameters
        ----------
        floor_depth_m : float, at most 11000
            How deep it is where nothing is known; default: a guess
        """
        return await self._call(Call[models.ForecastView](
            "POST",
            "/forecast",
            models.ForecastView,
            body=body,
            query={"floor_depth_m": floor_depth_m},
        ))

    async def preview_plan(
        self,
        body: models.MissionSpec | Mapping[str, Any],
        *,
        floor_depth_m: float | None = None,
    ) -> models.PlanView:
        """Plan a mission that is being described: ``POST /plan``.

        Parameters
        ----------
        floor_depth_m : float, at most 11000
            How deep it is where nothing is known; default: a guess
        """
        return await self._call(Call[models.PlanView](
            "POST",
            "/plan",
            models.PlanView,
            body=body,
            query={"floor_depth_m": floor_depth_m},
        ))

    async def post_measurements(
        self,
        mission_id: str,
        body: models.MeasurementBatch | Mapping[str, Any],
        *,
        idempotency_key: str | None = None,
    ) -> models.BatchVerdict:
        """Post measurements: ``POST /missions/{mission_id}/measurements``.

        Parameters
        ----------
        idempotency_key : str
            Name of this batch, made by the sender. Sent again by the same sender with the same key and content,
            nothing is stored twice and the first answer is given again
        """
        return await self._call(Call[models.BatchVerdict](
            "POST",
            f"/missions/{part(mission_id)}/measurements",
            models.BatchVerdict,
            body=body,
            headers={"idempotency-key": idempotency_key},
        ))

    async def get_waypoint(
        self,
        mission_id: str,
        name: str,
        *,
        after_step: int | None = None,
        timeout_s: float | None = None,
    ) -> models.WaypointView | None:
        """Fetch a vehicle's waypoint: ``GET /missions/{mission_id}/vehicles/{name}/waypoint``.

        Parameters
        ----------
        after_step : int
            Step of the newest waypoint that the vehicle has: only a newer one is sent
        timeout_s : float, 0 to 60.0, default 25.0
            How long to wait for one, wall-clock seconds
        """
        return await self._call(Call[models.WaypointView | None](
            "GET",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/waypoint",
            models.WaypointView,
            query={"after_step": after_step, "timeout_s": timeout_s},
        ))

    async def get_corrections(self, mission_id: str) -> models.CorrectionsView:
        """See how soundings are corrected: ``GET /missions/{mission_id}/corrections``."""
        return await self._call(Call[models.CorrectionsView](
            "GET",
            f"/missions/{part(mission_id)}/corrections",
            models.CorrectionsView,
        ))

    async def set_tide(
        self,
        mission_id: str,
        body: models.TideCorrection | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Correct the tide: ``PUT /missions/{mission_id}/tide``."""
        return await self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/tide",
            models.CorrectionsView,
            body=body,
        ))

    async def set_sound_speed(
        self,
        mission_id: str,
        body: models.SoundSpeed | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Correct the sound speed: ``PUT /missions/{mission_id}/sound-speed``."""
        return await self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/sound-speed",
            models.CorrectionsView,
            body=body,
        ))

    async def delete_sound_speed(self, mission_id: str) -> models.CorrectionsView:
        """Take the sonars' own ranges: ``DELETE /missions/{mission_id}/sound-speed``."""
        return await self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/sound-speed",
            models.CorrectionsView,
        ))

    async def get_casts(self, mission_id: str, *, order: models.Order | None = None) -> models.CastsView:
        """See what each cast corrects: ``GET /missions/{mission_id}/sound-speed/casts``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that differences between casts are compared with
        """
        return await self._call(Call[models.CastsView](
            "GET",
            f"/missions/{part(mission_id)}/sound-speed/casts",
            models.CastsView,
            query={"order": order},
        ))

    async def add_casts(self, mission_id: str, body: models.NewCasts | Mapping[str, Any]) -> models.CorrectionsView:
        """Add sound speed casts: ``POST /missions/{mission_id}/sound-speed/casts``."""
        return await self._call(Call[models.CorrectionsView](
            "POST",
            f"/missions/{part(mission_id)}/sound-speed/casts",
            models.CorrectionsView,
            body=body,
        ))

    async def get_measured_casts(
        self,
        mission_id: str,
        *,
        vehicle: str | None = None,
        from_s: float | None = None,
        until_s: float | None = None,
    ) -> list[models.VehicleCastView]:
        """See the sound speed casts that vehicles measured: ``GET /missions/{mission_id}/sound-speed/measured``.

        Parameters
        ----------
        vehicle : str
            Whose; default: of all
        from_s : float
            Of what was measured from then on
        until_s : float
            Of what was measured until then
        """
        return await self._call(Call[list[models.VehicleCastView]](
            "GET",
            f"/missions/{part(mission_id)}/sound-speed/measured",
            list[models.VehicleCastView],
            query={"vehicle": vehicle, "from_s": from_s, "until_s": until_s},
        ))

    async def set_cast(
        self,
        mission_id: str,
        name: str,
        body: models.CastDescription | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Add or replace a sound speed cast: ``PUT /missions/{mission_id}/sound-speed/casts/{name}``."""
        return await self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/sound-speed/casts/{part(name)}",
            models.CorrectionsView,
            body=body,
        ))

    async def delete_cast(self, mission_id: str, name: str) -> models.CorrectionsView:
        """Remove a sound speed cast: ``DELETE /missions/{mission_id}/sound-speed/casts/{name}``."""
        return await self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/sound-speed/casts/{part(name)}",
            models.CorrectionsView,
        ))

    async def set_cast_rule(
        self,
        mission_id: str,
        body: models.CastRules | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Choose sound speed casts by a rule: ``PUT /missions/{mission_id}/sound-speed/rule``."""
        return await self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/sound-speed/rule",
            models.CorrectionsView,
            body=body,
        ))

    async def set_mounting(
        self,
        mission_id: str,
        name: str,
        body: models.MountingSpec | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Correct how a sonar is mounted: ``PUT /missions/{mission_id}/mountings/{name}``."""
        return await self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/mountings/{part(name)}",
            models.CorrectionsView,
            body=body,
        ))

    async def delete_mounting(self, mission_id: str, name: str) -> models.CorrectionsView:
        """Take a sonar as its vehicle states it is mounted: ``DELETE /missions/{mission_id}/mountings/{name}``."""
        return await self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/mountings/{part(name)}",
            models.CorrectionsView,
        ))

    async def estimate_mounting(
        self,
        mission_id: str,
        name: str,
        body: models.MountingEstimateRequest | Mapping[str, Any] | None = None,
    ) -> models.MountingEstimateView:
        """Estimate how a sonar is mounted: ``POST /missions/{mission_id}/mountings/{name}/estimate``."""
        return await self._call(Call[models.MountingEstimateView](
            "POST",
            f"/missions/{part(mission_id)}/mountings/{part(name)}/estimate",
            models.MountingEstimateView,
            body=body,
        ))

    async def get_systematic_errors(self, mission_id: str) -> models.SystematicErrorsView:
        """See what is always wrong: ``GET /missions/{mission_id}/systematic-errors``."""
        return await self._call(Call[models.SystematicErrorsView](
            "GET",
            f"/missions/{part(mission_id)}/systematic-errors",
            models.SystematicErrorsView,
        ))

    async def set_systematic_errors(
        self,
        mission_id: str,
        body: models.SystematicErrors | Mapping[str, Any],
    ) -> models.CorrectionsView:
        """Take out what is always wrong: ``PUT /missions/{mission_id}/systematic-errors``."""
        return await self._call(Call[models.CorrectionsView](
            "PUT",
            f"/missions/{part(mission_id)}/systematic-errors",
            models.CorrectionsView,
            body=body,
        ))

    async def delete_systematic_errors(self, mission_id: str) -> models.CorrectionsView:
        """Take nothing out: ``DELETE /missions/{mission_id}/systematic-errors``."""
        return await self._call(Call[models.CorrectionsView](
            "DELETE",
            f"/missions/{part(mission_id)}/systematic-errors",
            models.CorrectionsView,
        ))

    async def get_adjustment(self, mission_id: str) -> models.AdjustmentView:
        """See how tracks are adjusted: ``GET /missions/{mission_id}/adjustment``."""
        return await self._call(Call[models.AdjustmentView](
            "GET",
            f"/missions/{part(mission_id)}/adjustment",
            models.AdjustmentView,
        ))

    async def adjust_tracks(
        self,
        mission_id: str,
        body: models.AdjustmentRequest | Mapping[str, Any] | None = None,
    ) -> models.AdjustmentView:
        """Adjust tracks for drift: ``POST /missions/{mission_id}/adjustment``."""
        return await self._call(Call[models.AdjustmentView](
            "POST",
            f"/missions/{part(mission_id)}/adjustment",
            models.AdjustmentView,
            body=body,
        ))

    async def undo_adjustment(self, mission_id: str) -> models.AdjustmentView:
        """Take positions as they came: ``DELETE /missions/{mission_id}/adjustment``."""
        return await self._call(Call[models.AdjustmentView](
            "DELETE",
            f"/missions/{part(mission_id)}/adjustment",
            models.AdjustmentView,
        ))

    async def import_soundings(
        self,
        mission_id: str,
        content: bytes,
        *,
        filename: str,
        source: str | None = None,
        crs: str | None = None,
        positive: Literal["down", "up"] | None = None,
        sd_m: float | None = None,
        order: models.Order | None = None,
        datum_offset_m: float | None = None,
    ) -> models.ImportView:
        """Begin with soundings or a map from elsewhere: ``POST /missions/{mission_id}/imports``.

        Parameters
        ----------
        filename : str
            Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc, .bag, .h5
            (S-102), .000 (ENC cell), .gsf or .kmall (multibeam sonars)
        source : str
            Where it comes from, kept with the mission
        crs : str
            What positions are in where the file does not say: EPSG:4326, EPSG:32629, WKT, or local for the
            mission's own frame
        positive : Literal["down", "up"]
            Which way values grow: down for depths, up for heights; default: what the file says
        sd_m : float, at most 1000
            Standard deviation of the depths that state none, metres
        order : models.Order
            In place of sd_m: the S-44 order surveyed to; its largest TVU is assumed
        datum_offset_m : float, -200 to 200
            Added to every depth to bring it to the mission's datum, 0 where that is the file's; has to be said
            where the file states another one
        """
        return await self._call(Call[models.ImportView](
            "POST",
            f"/missions/{part(mission_id)}/imports",
            models.ImportView,
            content=content,
            query={"filename": filename, "source": source, "crs": crs, "positive": positive, "sd_m": sd_m, "order": order, "datum_offset_m": datum_offset_m},
        ))

    async def list_imports(self, mission_id: str) -> list[models.ImportView]:
        """List what was imported: ``GET /missions/{mission_id}/imports``."""
        return await self._call(Call[list[models.ImportView]](
            "GET",
            f"/missions/{part(mission_id)}/imports",
            list[models.ImportView],
        ))

    async def delete_import(self, mission_id: str, import_id: str) -> None:
        """Take an import back: ``DELETE /missions/{mission_id}/imports/{import_id}``."""
        return await self._call(Call[None]("DELETE", f"/missions/{part(mission_id)}/imports/{part(import_id)}", None))

    async def import_log(
        self,
        mission_id: str,
        content: bytes,
        *,
        filename: str,
        vehicle: str | None = None,
    ) -> models.LogView:
        """Import a vehicle's own log: ``POST /missions/{mission_id}/logs``.

        Parameters
        ----------
        filename : str
            Its name; .gsf and .kmall are files of a multibeam, everything else is read as a log of DUNE
            (Data.lsf, Data.lsf.gz)
        vehicle : str
            Name of the vehicle; default: the one that the log announces, which a multibeam's file does not
        """
        return await self._call(Call[models.LogView](
            "POST",
            f"/missions/{part(mission_id)}/logs",
            models.LogView,
            content=content,
            query={"filename": filename, "vehicle": vehicle},
        ))

    async def list_logs(self, mission_id: str) -> list[models.LogView]:
        """List the logs that were imported: ``GET /missions/{mission_id}/logs``."""
        return await self._call(Call[list[models.LogView]](
            "GET",
            f"/missions/{part(mission_id)}/logs",
            list[models.LogView],
        ))

    async def get_log(self, mission_id: str, import_id: str) -> models.LogView:
        """See what came of a log, or how far it is: ``GET /missions/{mission_id}/logs/{import_id}``."""
        return await self._call(Call[models.LogView](
            "GET",
            f"/missions/{part(mission_id)}/logs/{part(import_id)}",
            models.LogView,
        ))

    async def delete_log(self, mission_id: str, import_id: str) -> models.LogView:
        """Stop reading a log, or take it back: ``DELETE /missions/{mission_id}/logs/{import_id}``."""
        return await self._call(Call[models.LogView](
            "DELETE",
            f"/missions/{part(mission_id)}/logs/{part(import_id)}",
            models.LogView,
        ))

    async def set_reference(
        self,
        mission_id: str,
        content: bytes,
        *,
        filename: str,
        source: str | None = None,
        crs: str | None = None,
        positive: Literal["down", "up"] | None = None,
        sd_m: float | None = None,
        order: models.Order | None = None,
        datum_offset_m: float | None = None,
    ) -> models.ReferenceView:
        """Compare the map with a grid: ``PUT /missions/{mission_id}/reference``.

        Parameters
        ----------
        filename : str
            Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc, .bag, .h5
            (S-102), .000 (ENC cell), .gsf or .kmall (multibeam sonars)
        source : str
            Where it comes from, kept with the mission
        crs : str
            What positions are in where the file does not say: EPSG:4326, EPSG:32629, WKT, or local for the
            mission's own frame
        positive : Literal["down", "up"]
            Which way values grow: down for depths, up for heights; default: what the file says
        sd_m : float, at most 1000
            Standard deviation of the depths that state none, metres
        order : models.Order
            In place of sd_m: the S-44 order surveyed to; its largest TVU is assumed
        datum_offset_m : float, -200 to 200
            Added to every depth to bring it to the mission's datum, 0 where that is the file's; has to be said
            where the file states another one
        """
        return await self._call(Call[models.ReferenceView](
            "PUT",
            f"/missions/{part(mission_id)}/reference",
            models.ReferenceView,
            content=content,
            query={"filename": filename, "source": source, "crs": crs, "positive": positive, "sd_m": sd_m, "order": order, "datum_offset_m": datum_offset_m},
        ))

    async def get_reference(self, mission_id: str) -> models.ReferenceView:
        """See what the map is compared with: ``GET /missions/{mission_id}/reference``."""
        return await self._call(Call[models.ReferenceView](
            "GET",
            f"/missions/{part(mission_id)}/reference",
            models.ReferenceView,
        ))

    async def delete_reference(self, mission_id: str) -> None:
        """Compare the map with nothing: ``DELETE /missions/{mission_id}/reference``."""
        return await self._call(Call[None]("DELETE", f"/missions/{part(mission_id)}/reference", None))

    async def propose_zones(
        self,
        content: bytes,
        *,
        west_deg: float,
        south_deg: float,
        east_deg: float,
        north_deg: float,
        margin_m: float | None = None,
    ) -> models.ProposedZonesView:
        """Propose keep-out zones from a chart: ``POST /chart-zones``.

        Parameters
        ----------
        west_deg : float, -180 to 180
            Western end of the area
        south_deg : float, -90 to 90
            Southern end of the area
        east_deg : float, -180 to 180
            Eastern end of the area
        north_deg : float, -90 to 90
            Northern end of the area
        margin_m : float, 0 to 1000, default 10.0
            How much all of it is enlarged, beside how well its place is known
        """
        return await self._call(Call[models.ProposedZonesView](
            "POST",
            "/chart-zones",
            models.ProposedZonesView,
            content=content,
            query={"west_deg": west_deg, "south_deg": south_deg, "east_deg": east_deg, "north_deg": north_deg, "margin_m": margin_m},
        ))

    async def read_drawing(
        self,
        content: bytes,
        *,
        filename: str,
        crs: str | None = None,
        margin_m: float | None = None,
    ) -> models.DrawingView:
        """Read the lines and areas of a file: ``POST /drawings``.

        Parameters
        ----------
        filename : str
            Its name; the ending says what it is: .geojson, .json, .kml, .kmz, .gpx, .dxf, .zip (a shapefile),
            .csv or .txt (name and position in each row), or .lnw (Hypack)
        crs : str
            What positions are in where the file does not say: EPSG:32629, EPSG:4326 or WKT
        margin_m : float, 1 to 2000, default 50.0
            How far the area around the lines reaches beyond them
        """
        return await self._call(Call[models.DrawingView](
            "POST",
            "/drawings",
            models.DrawingView,
            content=content,
            query={"filename": filename, "crs": crs, "margin_m": margin_m},
        ))

    async def get_map(
        self,
        mission_id: str,
        *,
        layer: list[models.LayerName] | None = None,
        order: models.Order | None = None,
    ) -> models.MapView:
        """See the map: ``GET /missions/{mission_id}/map``.

        Parameters
        ----------
        layer : list[models.LayerName]
            Further layers, in `layers`; repeat it for several
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return await self._call(Call[models.MapView](
            "GET",
            f"/missions/{part(mission_id)}/map",
            models.MapView,
            query={"layer": layer, "order": order},
        ))

    async def get_map_overlay(
        self,
        mission_id: str,
        *,
        layer: models.OverlayLayer | None = None,
        order: models.Order | None = None,
        min: float | None = None,
        max: float | None = None,
    ) -> bytes:
        """See the map as a transparent picture: ``GET /missions/{mission_id}/map.overlay.png``.

        Parameters
        ----------
        layer : models.OverlayLayer, default depth
            What is shown
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        min : float, -20000.0 to 20000.0
            Value at the palette's begin, m; default: the map's least
        max : float, -20000.0 to 20000.0
            Value at the palette's end, m; default: the map's largest
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/map.overlay.png",
            bytes,
            query={"layer": layer, "order": order, "min": min, "max": max},
        ))

    async def get_map_tiles(
        self,
        mission_id: str,
        *,
        since: str | None = None,
        layer: list[models.FurtherLayer] | None = None,
        step: int | None = None,
    ) -> bytes:
        """Follow the map: ``GET /missions/{mission_id}/map/tiles``.

        Parameters
        ----------
        since : str
            `tag` of the map that the client has
        layer : list[models.FurtherLayer]
            Layers beside the usual ones
        step : int
            The map as it was at the end of this step; default: the newest
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/map/tiles",
            bytes,
            query={"since": since, "layer": layer, "step": step},
        ))

    async def get_quality(self, mission_id: str) -> models.QualityView:
        """Judge the map: ``GET /missions/{mission_id}/quality``."""
        return await self._call(Call[models.QualityView](
            "GET",
            f"/missions/{part(mission_id)}/quality",
            models.QualityView,
        ))

    async def get_uncertainty_budget(self, mission_id: str) -> models.UncertaintyBudgetView:
        """See where uncertainty comes from: ``GET /missions/{mission_id}/uncertainty-budget``."""
        return await self._call(Call[models.UncertaintyBudgetView](
            "GET",
            f"/missions/{part(mission_id)}/uncertainty-budget",
            models.UncertaintyBudgetView,
        ))

    async def get_holidays(self, mission_id: str) -> dict[str, Any]:
        """See what swath sonars missed: ``GET /missions/{mission_id}/holidays``."""
        return await self._call(Call[dict[str, Any]]("GET", f"/missions/{part(mission_id)}/holidays", dict[str, Any]))

    async def get_crosslines(self, mission_id: str, *, order: models.Order | None = None) -> models.CrossoversView:
        """See how well the survey agrees with itself: ``GET /missions/{mission_id}/crosslines``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return await self._call(Call[models.CrossoversView](
            "GET",
            f"/missions/{part(mission_id)}/crosslines",
            models.CrossoversView,
            query={"order": order},
        ))

    async def get_crossovers_file(self, mission_id: str, *, order: models.Order | None = None) -> str:
        """Download the crossings: ``GET /missions/{mission_id}/crossovers.csv``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return await self._call(Call[str](
            "GET",
            f"/missions/{part(mission_id)}/crossovers.csv",
            str,
            query={"order": order},
        ))

    async def list_products(self, mission_id: str) -> list[models.ProductView]:
        """List the files: ``GET /missions/{mission_id}/products``."""
        return await self._call(Call[list[models.ProductView]](
            "GET",
            f"/missions/{part(mission_id)}/products",
            list[models.ProductView],
        ))

    async def get_holidays_file(self, mission_id: str) -> dict[str, Any]:
        """Download the holidays: ``GET /missions/{mission_id}/holidays.geojson``."""
        return await self._call(Call[dict[str, Any]](
            "GET",
            f"/missions/{part(mission_id)}/holidays.geojson",
            dict[str, Any],
        ))

    async def get_pdf_report(
        self,
        mission_id: str,
        *,
        lang: models.Language | None = None,
        order: models.Order | None = None,
    ) -> bytes:
        """Download the survey's report as PDF: ``GET /missions/{mission_id}/report.pdf``.

        Parameters
        ----------
        lang : models.Language, default en
            Language that it is written in
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/report.pdf",
            bytes,
            query={"lang": lang, "order": order},
        ))

    async def get_html_report(
        self,
        mission_id: str,
        *,
        lang: models.Language | None = None,
        order: models.Order | None = None,
    ) -> bytes:
        """Download the survey's report as HTML: ``GET /missions/{mission_id}/report.html``.

        Parameters
        ----------
        lang : models.Language, default en
            Language that it is written in
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/report.html",
            bytes,
            query={"lang": lang, "order": order},
        ))

    async def get_map_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the map: ``GET /missions/{mission_id}/map.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/map.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    async def get_contours_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the contours: ``GET /missions/{mission_id}/contours.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/contours.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    async def get_soundings_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the soundings: ``GET /missions/{mission_id}/soundings.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/soundings.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    async def get_tracks_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the tracks: ``GET /missions/{mission_id}/tracks.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/tracks.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    async def get_lines_file(
        self,
        mission_id: str,
        format: str,
        *,
        order: models.Order | None = None,
        interval_m: float | None = None,
        min: float | None = None,
        max: float | None = None,
        vehicle: str | None = None,
        crs: str | None = None,
    ) -> bytes:
        """Download the log of lines: ``GET /missions/{mission_id}/lines.{format}``.

        Parameters
        ----------
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        interval_m : float, at most 1000
            Between contours; default: about ten
        min : float, -20000.0 to 20000.0
            A picture's least depth
        max : float, -20000.0 to 20000.0
            Its largest depth
        vehicle : str
            Whose soundings, in crowdsourced bathymetry; default: the only vehicle's
        crs : str
            System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; default: the
            mission's own frame, in XYZ longitude and latitude
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/lines.{part(format)}",
            bytes,
            query={"order": order, "interval_m": interval_m, "min": min, "max": max, "vehicle": vehicle, "crs": crs},
        ))

    async def get_profile(
        self,
        mission_id: str,
        *,
        line: str,
        spacing_m: float | None = None,
        within_m: float | None = None,
        layer: list[models.LayerName] | None = None,
        order: models.Order | None = None,
    ) -> models.ProfileView:
        """See the map along a line: ``GET /missions/{mission_id}/profile``.

        Parameters
        ----------
        line : str
            Its 2 to 100 corners as longitude,latitude, with ; between them
        spacing_m : float, at most 1000.0
            Between points; default: half a cell
        within_m : float, at most 1000.0
            From the line to soundings at most; default: one cell
        layer : list[models.LayerName]
            Further layers, in `layers`; repeat it for several
        order : models.Order, default 1a
            Order of IHO S-44 that the TVU is compared with
        """
        return await self._call(Call[models.ProfileView](
            "GET",
            f"/missions/{part(mission_id)}/profile",
            models.ProfileView,
            query={"line": line, "spacing_m": spacing_m, "within_m": within_m, "layer": layer, "order": order},
        ))

    async def list_layers(self) -> list[models.LayerView]:
        """List the layers of maps: ``GET /layers``."""
        return await self._call(Call[list[models.LayerView]]("GET", "/layers", list[models.LayerView]))

    async def get_tile_json(
        self,
        mission_id: str,
        layer: str,
        *,
        min: float | None = None,
        max: float | None = None,
    ) -> models.TileJson:
        """See where a layer's tiles are: ``GET /missions/{mission_id}/tiles/{layer}.json``.

        Parameters
        ----------
        min : float, -20000.0 to 20000.0
            Value of the first colour; default: what the layer's TileJSON says
        max : float, -20000.0 to 20000.0
            Value of the last colour; default: what the layer's TileJSON says
        """
        return await self._call(Call[models.TileJson](
            "GET",
            f"/missions/{part(mission_id)}/tiles/{part(layer)}.json",
            models.TileJson,
            query={"min": min, "max": max},
        ))

    async def get_tile(
        self,
        mission_id: str,
        layer: str,
        z: int,
        x: int,
        y: str,
        *,
        min: float | None = None,
        max: float | None = None,
    ) -> bytes:
        """See the map as tiles: ``GET /missions/{mission_id}/tiles/{layer}/{z}/{x}/{y}.png``.

        Parameters
        ----------
        min : float, -20000.0 to 20000.0
            Value of the first colour; default: what the layer's TileJSON says
        max : float, -20000.0 to 20000.0
            Value of the last colour; default: what the layer's TileJSON says
        """
        return await self._call(Call[bytes](
            "GET",
            f"/missions/{part(mission_id)}/tiles/{part(layer)}/{part(z)}/{part(x)}/{part(y)}.png",
            bytes,
            query={"min": min, "max": max},
        ))

    async def list_soundings(
        self,
        mission_id: str,
        *,
        state: list[models.SoundingState] | None = None,
        vehicle: str | None = None,
        after: int | None = None,
        limit: int | None = None,
    ) -> models.SoundingPage:
        """See which soundings are not in the map, and why: ``GET /missions/{mission_id}/soundings``.

        Parameters
        ----------
        state : list[models.SoundingState]
            Only soundings in these states; default: all that are not simply used
        vehicle : str
            Only this vehicle's
        after : int, default 0
            Only soundings with a larger id
        limit : int, 1 to 1000, default 200
            Most soundings in the answer
        """
        return await self._call(Call[models.SoundingPage](
            "GET",
            f"/missions/{part(mission_id)}/soundings",
            models.SoundingPage,
            query={"state": state, "vehicle": vehicle, "after": after, "limit": limit},
        ))

    async def list_sounding_points(
        self,
        mission_id: str,
        *,
        after: int | None = None,
        limit: int | None = None,
    ) -> models.SoundingPoints:
        """See all soundings as points: ``GET /missions/{mission_id}/soundings/points``.

        Parameters
        ----------
        after : int, default 0
            Only soundings with a larger id
        limit : int, 1 to 20000, default 20000
            Most soundings in the answer
        """
        return await self._call(Call[models.SoundingPoints](
            "GET",
            f"/missions/{part(mission_id)}/soundings/points",
            models.SoundingPoints,
            query={"after": after, "limit": limit},
        ))

    async def restore_soundings(
        self,
        mission_id: str,
        body: models.RulingRequest | Mapping[str, Any],
    ) -> models.RulingsView:
        """Let many soundings count: ``POST /missions/{mission_id}/soundings/restore``."""
        return await self._call(Call[models.RulingsView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/restore",
            models.RulingsView,
            body=body,
        ))

    async def reject_soundings(
        self,
        mission_id: str,
        body: models.RulingRequest | Mapping[str, Any],
    ) -> models.RulingsView:
        """Keep many soundings out: ``POST /missions/{mission_id}/soundings/reject``."""
        return await self._call(Call[models.RulingsView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/reject",
            models.RulingsView,
            body=body,
        ))

    async def restore_sounding(
        self,
        mission_id: str,
        sounding_id: int,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.SoundingView:
        """Let a sounding count: ``POST /missions/{mission_id}/soundings/{sounding_id}/restore``."""
        return await self._call(Call[models.SoundingView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/{part(sounding_id)}/restore",
            models.SoundingView,
            body=body,
        ))

    async def reject_sounding(
        self,
        mission_id: str,
        sounding_id: int,
        body: models.ActionRequest | Mapping[str, Any] | None = None,
    ) -> models.SoundingView:
        """Keep a sounding out: ``POST /missions/{mission_id}/soundings/{sounding_id}/reject``."""
        return await self._call(Call[models.SoundingView](
            "POST",
            f"/missions/{part(mission_id)}/soundings/{part(sounding_id)}/reject",
            models.SoundingView,
            body=body,
        ))

    async def list_pings(self, mission_id: str) -> models.PingsView:
        """See which pings there are: ``GET /missions/{mission_id}/pings``."""
        return await self._call(Call[models.PingsView]("GET", f"/missions/{part(mission_id)}/pings", models.PingsView))

    async def get_pings(self, mission_id: str, number: int) -> bytes:
        """Fetch a file of pings: ``GET /missions/{mission_id}/pings/{number}``."""
        return await self._call(Call[bytes]("GET", f"/missions/{part(mission_id)}/pings/{part(number)}", bytes))

    async def select_beams(
        self,
        mission_id: str,
        body: models.BeamPointsRequest | Mapping[str, Any],
    ) -> models.BeamPoints:
        """See beams as points: ``POST /missions/{mission_id}/beams/points``."""
        return await self._call(Call[models.BeamPoints](
            "POST",
            f"/missions/{part(mission_id)}/beams/points",
            models.BeamPoints,
            body=body,
        ))

    async def reject_beams(
        self,
        mission_id: str,
        body: models.BeamRulingRequest | Mapping[str, Any],
    ) -> models.BeamEditView:
        """Keep beams out: ``POST /missions/{mission_id}/beams/reject``."""
        return await self._call(Call[models.BeamEditView](
            "POST",
            f"/missions/{part(mission_id)}/beams/reject",
            models.BeamEditView,
            body=body,
        ))

    async def restore_beams(
        self,
        mission_id: str,
        body: models.BeamRulingRequest | Mapping[str, Any],
    ) -> models.BeamEditView:
        """Let beams count: ``POST /missions/{mission_id}/beams/restore``."""
        return await self._call(Call[models.BeamEditView](
            "POST",
            f"/missions/{part(mission_id)}/beams/restore",
            models.BeamEditView,
            body=body,
        ))

    async def list_beam_edits(self, mission_id: str) -> models.BeamEditsView:
        """See what was said of beams: ``GET /missions/{mission_id}/beams/edits``."""
        return await self._call(Call[models.BeamEditsView](
            "GET",
            f"/missions/{part(mission_id)}/beams/edits",
            models.BeamEditsView,
        ))

    async def withdraw_beam_edit(self, mission_id: str, edit_id: int) -> models.BeamEditsView:
        """Take back what was said of beams: ``DELETE /missions/{mission_id}/beams/edits/{edit_id}``."""
        return await self._call(Call[models.BeamEditsView](
            "DELETE",
            f"/missions/{part(mission_id)}/beams/edits/{part(edit_id)}",
            models.BeamEditsView,
        ))

    async def list_targets(self, mission_id: str) -> list[models.TargetView]:
        """See what is known of a mission's moving targets: ``GET /missions/{mission_id}/targets``."""
        return await self._call(Call[list[models.TargetView]](
            "GET",
            f"/missions/{part(mission_id)}/targets",
            list[models.TargetView],
        ))

    async def list_target_ranges(
        self,
        mission_id: str,
        *,
        target: str | None = None,
        after: int | None = None,
        limit: int | None = None,
    ) -> models.TargetRangePage:
        """See the ranges to targets, and which were used: ``GET /missions/{mission_id}/targets/ranges``.

        Parameters
        ----------
        target : str
            Only ranges to this target
        after : int, default 0
            Only ranges with a larger id
        limit : int, 1 to 1000, default 200
            Most ranges in the answer
        """
        return await self._call(Call[models.TargetRangePage](
            "GET",
            f"/missions/{part(mission_id)}/targets/ranges",
            models.TargetRangePage,
            query={"target": target, "after": after, "limit": limit},
        ))

    async def post_scans(self, mission_id: str, body: models.ScanBatch | Mapping[str, Any]) -> models.BatchVerdict:
        """Post scans: ``POST /missions/{mission_id}/scans``."""
        return await self._call(Call[models.BatchVerdict](
            "POST",
            f"/missions/{part(mission_id)}/scans",
            models.BatchVerdict,
            body=body,
        ))

    async def get_search(self, mission_id: str, *, after: int | None = None) -> models.SearchGridView | None:
        """See the site of a search as known now: ``GET /missions/{mission_id}/search``.

        Parameters
        ----------
        after : int
            Only what is newer than this version
        """
        return await self._call(Call[models.SearchGridView | None](
            "GET",
            f"/missions/{part(mission_id)}/search",
            models.SearchGridView,
            query={"after": after},
        ))

    async def get_search_obstacles(self, mission_id: str) -> dict[str, Any]:
        """Download the obstacles of a search as GeoJSON: ``GET /missions/{mission_id}/search/obstacles.geojson``."""
        return await self._call(Call[dict[str, Any]](
            "GET",
            f"/missions/{part(mission_id)}/search/obstacles.geojson",
            dict[str, Any],
        ))

    async def get_events(
        self,
        mission_id: str,
        *,
        after: int | None = None,
        limit: int | None = None,
    ) -> list[models.EventView]:
        """Follow or read a mission's log: ``GET /missions/{mission_id}/events``.

        Parameters
        ----------
        after : int, default 0
            Only entries with a larger id, like `Last-Event-ID`, which is stronger
        limit : int, 1 to 1000, default 1000
            Most entries in a list
        """
        return await self._call(Call[list[models.EventView]](
            "GET",
            f"/missions/{part(mission_id)}/events",
            list[models.EventView],
            query={"after": after, "limit": limit},
        ))

    async def list_vehicles(self) -> list[models.VehicleView]:
        """List the vehicles: ``GET /vehicles``."""
        return await self._call(Call[list[models.VehicleView]]("GET", "/vehicles", list[models.VehicleView]))

    async def examine_links(self) -> models.DoctorView:
        """Say what is missing: ``GET /doctor``."""
        return await self._call(Call[models.DoctorView]("GET", "/doctor", models.DoctorView))

    async def list_ships(self) -> models.TrafficView:
        """List the ships about: ``GET /traffic``."""
        return await self._call(Call[models.TrafficView]("GET", "/traffic", models.TrafficView))

    async def list_planners(self) -> list[models.PlannerView]:
        """List the planners: ``GET /planners``."""
        return await self._call(Call[list[models.PlannerView]]("GET", "/planners", list[models.PlannerView]))

    async def list_orders(self, mission_id: str) -> list[models.OrderView]:
        """See what vehicles were ordered: ``GET /missions/{mission_id}/orders``."""
        return await self._call(Call[list[models.OrderView]](
            "GET",
            f"/missions/{part(mission_id)}/orders",
            list[models.OrderView],
        ))

    async def go_vehicle(
        self,
        mission_id: str,
        name: str,
        body: models.GoOrder | Mapping[str, Any],
    ) -> models.OrderView:
        """Send one vehicle to a place now: ``POST /missions/{mission_id}/vehicles/{name}/go``."""
        return await self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/go",
            models.OrderView,
            body=body,
        ))

    async def skip_line(self, mission_id: str, name: str) -> models.OrderView:
        """Leave out the rest of a vehicle's line: ``POST /missions/{mission_id}/vehicles/{name}/skip-line``."""
        return await self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/skip-line",
            models.OrderView,
        ))

    async def repeat_line(
        self,
        mission_id: str,
        name: str,
        body: models.RepeatOrder | Mapping[str, Any] | None = None,
    ) -> models.OrderView:
        """Let a vehicle fly a line again: ``POST /missions/{mission_id}/vehicles/{name}/repeat-line``."""
        return await self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/vehicles/{part(name)}/repeat-line",
            models.OrderView,
            body=body,
        ))

    async def survey_denser(self, mission_id: str, body: models.DenserOrder | Mapping[str, Any]) -> models.OrderView:
        """Survey a part of the area denser: ``POST /missions/{mission_id}/denser``."""
        return await self._call(Call[models.OrderView](
            "POST",
            f"/missions/{part(mission_id)}/denser",
            models.OrderView,
            body=body,
        ))

    async def list_alarms(
        self,
        *,
        state: models.AlarmState | None = None,
        mission: str | None = None,
        limit: int | None = None,
    ) -> list[models.AlarmReport]:
        """List alarms: ``GET /alarms``.

        Parameters
        ----------
        state : models.AlarmState
            Only these; left out: all
        mission : str
            Only those of the mission with this id
        limit : int, 1 to 1000, default 200
            Most alarms in the answer
        """
        return await self._call(Call[list[models.AlarmReport]](
            "GET",
            "/alarms",
            list[models.AlarmReport],
            query={"state": state, "mission": mission, "limit": limit},
        ))

    async def test_alarm(self, body: models.AlarmTrial | Mapping[str, Any] | None = None) -> models.AlarmReport:
        """Try who is told: ``POST /alarms/test``."""
        return await self._call(Call[models.AlarmReport]("POST", "/alarms/test", models.AlarmReport, body=body))

    async def get_alarm(self, alarm_id: str) -> models.AlarmReport:
        """See an alarm: ``GET /alarms/{alarm_id}``."""
        return await self._call(Call[models.AlarmReport]("GET", f"/alarms/{part(alarm_id)}", models.AlarmReport))

    async def acknowledge_alarm(self, alarm_id: str) -> models.AlarmReport:
        """Take an alarm: ``POST /alarms/{alarm_id}/acknowledge``."""
        return await self._call(Call[models.AlarmReport](
            "POST",
            f"/alarms/{part(alarm_id)}/acknowledge",
            models.AlarmReport,
        ))

    async def list_audit(
        self,
        *,
        before: int | None = None,
        days: float | None = None,
        actor: str | None = None,
        mission: str | None = None,
        limit: int | None = None,
    ) -> list[models.AuditEntry]:
        """See who commanded what: ``GET /audit``.

        Parameters
        ----------
        before : int
            Only older entries than that of this id
        days : float, at most 36500
            Only entries of the last so many days
        actor : str
            Only of the token of this name
        mission : str
            Only to the mission of this id
        limit : int, 1 to 1000, default 100
            Most entries in the answer
        """
        return await self._call(Call[list[models.AuditEntry]](
            "GET",
            "/audit",
            list[models.AuditEntry],
            query={"before": before, "days": days, "actor": actor, "mission": mission, "limit": limit},
        ))

    async def get_session(self) -> models.SessionView:
        """See who you are: ``GET /session``."""
        return await self._call(Call[models.SessionView]("GET", "/session", models.SessionView))

    async def sign_in(self) -> models.SessionView:
        """Sign a browser in: ``POST /session``."""
        return await self._call(Call[models.SessionView]("POST", "/session", models.SessionView))

    async def sign_out(self) -> None:
        """Sign a browser out: ``DELETE /session``."""
        return await self._call(Call[None]("DELETE", "/session", None))

    async def get_health(self) -> models.ComponentHealth:
        """See the service's health: ``GET /health``."""
        return await self._call(Call[models.ComponentHealth]("GET", "/health", models.ComponentHealth))

    async def get_liveness(self) -> models.Liveness:
        """Is the process alive: ``GET /health/live``."""
        return await self._call(Call[models.Liveness]("GET", "/health/live", models.Liveness))

    async def get_readiness(self) -> models.ComponentHealth:
        """Can it do its work: ``GET /health/ready``."""
        return await self._call(Call[models.ComponentHealth]("GET", "/health/ready", models.ComponentHealth))

    async def get_metrics(self) -> str:
        """Measurements for Prometheus: ``GET /metrics``."""
        return await self._call(Call[str]("GET", "/metrics", str))
