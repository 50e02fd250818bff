"""Sentences of AIS: of real ships, from the documentation and tests of pyais (MIT), and made by its encoder."""

from typing import Any

from pyais.encode import encode_dict

CLASS_A = b"!AIVDM,1,1,,B,15NG6V0P01G?cFhE`R2IU?wn28R>,0*05"
CLASS_B = b"!AIVDM,1,1,,A,B6CdCm0t3`tba35f@V9faHi7kP06,0*58"
STATIC = (
    b"!AIVDM,2,1,1,A,55?MbV02;H;s<HtKR20EHE:0@T4@Dn2222222216L961O5Gf0NSQEp6ClRp8,0*1C",
    b"!AIVDM,2,2,1,A,88888888880,2*25",
)
RECORDED = (
    b"!AIVDM,1,1,,A,13HOI:0P0000VOHLCnHQKwvL05Ip,0*23",
    b"!AIVDM,1,1,,A,133sVfPP00PD>hRMDH@jNOvN20S8,0*7F",
    b"!AIVDM,1,1,,A,14eGrSPP00ncMJTO5C6aBwvP2D0?,0*7A",
    b"!AIVDM,1,1,,A,15MrVH0000KH<:V:NtBLoqFP2H9:,0*2F",
    b"!AIVDM,1,1,,A,16:=?;0P00`SstvFnFbeGH6L088h,0*44",
    b"!AIVDM,1,1,,A,16`l:v8P0W8Vw>fDVB0t8OvJ0H;9,0*0A",
    b"!AIVDM,1,1,,A,169a:nP01g`hm4pB7:E0;@0L088i,0*5E",
)


def sentence(channel: str = "A", part: int = 0, seq_id: int = 0, **message: Any) -> bytes:
    """Return a sentence that says this; ``part``: which one, where it takes several."""
    made = encode_dict(message, radio_channel=channel, talker_id="AI", sentence_type="VDM", seq_id=seq_id)
    return made[part].encode()


def nmea(words: str) -> bytes:
    """Return a sentence of NMEA 0183 with its checksum."""
    checksum = 0
    for letter in words.encode():
        checksum ^= letter
    return f"${words}*{checksum:02X}".encode()


def position(mmsi: int, lat_deg: float, lon_deg: float, knots: float = 0.0, course_deg: float = 0.0) -> bytes:
    """Return where a ship of class A is."""
    return sentence(msg_type=1, mmsi=mmsi, lat=lat_deg, lon=lon_deg, speed=knots, course=course_deg, status=0)


def named(mmsi: int, name: str) -> list[bytes]:
    """Return the sentences that name a ship of 30 m by 8 m, with a draught of 3 m."""
    told: dict[str, Any] = {"msg_type": 5, "mmsi": mmsi, "shipname": name, "ship_type": 70, "draught": 3.0}
    sides: dict[str, Any] = {"to_bow": 20, "to_stern": 10, "to_port": 4, "to_starboard": 4}
    return [sentence("A", part, 1, **told, **sides) for part in (0, 1)]
