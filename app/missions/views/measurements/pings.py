"""What is answered about pings of swath sonars."""

from pydantic import Field

from app.missions.views.base import View


class PingPartView(View):
    """Some of a vehicle's pings: a file of them, or those that are in none yet."""

    number: int | None = Field(
        description="Of the file, for `GET /missions/{mission_id}/pings/{number}`; null: in no file yet"
    )
    vehicle: str
    first_time_s: float = Field(description="The vehicle's clock at the first ping, Unix seconds")
    last_time_s: float = Field(description="The vehicle's clock at the last ping, Unix seconds")
    pings: int = Field(description="Accepted ones")
    beams: int = Field(description="Their beams that detected something")
    rejected: int = Field(description="Pings that are kept but not used; the file says why")
    size_bytes: int | None = Field(description="Of the file")
    sha256: str | None = Field(description="Of the file")
    taken_back: bool = Field(
        default=False, description="True: they came by a log that was taken back, and do not count"
    )


class PingsView(View):
    """All pings of a mission, in the order in which they came."""

    pings: int = Field(description="Accepted ones of all parts that were not taken back")
    beams: int
    rejected: int
    parts: list[PingPartView]
