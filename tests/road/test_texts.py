"""What is refused before it is read, and the encodings that are not."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from hdvplan.errors import RoadError
from hdvplan.road.checks import text_of
from hdvplan.road.load import load_road

ROWS = "".join(f"{11.95 + 1e-4 * number:.6f};57,7;Hafenstraße\n".replace(".", ",") for number in range(5))


def refused(path: Path, message: str, hint: str) -> None:
    with pytest.raises(RoadError, match=message) as caught:
        load_road(path)
    assert hint in str(caught.value.hint)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["big.csv", "big.geojson", "big.gpkg", "big.xodr"])
def test_a_file_of_200_mb_is_refused_before_it_is_read(tmp_path: Path, name: str) -> None:
    with (tmp_path / name).open("wb") as file:
        file.truncate(200_000_000)  # takes no space
    refused(tmp_path / name, "has 200 MB", f"road.gpkg {name}")


@pytest.mark.parametrize("name", ["road.zip", "road.csv", "road.gpkg", "road.geojson"])
def test_an_archive_is_refused_with_what_it_holds(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / name, "w") as archive:
        archive.writestr("street.shp", b"")
        archive.writestr("street.dbf", b"")
    refused(tmp_path / name, "is a zip archive", "give the file in it: street.shp, street.dbf")


def test_packed_formats_are_refused_when_they_unpack_to_too_much_or_are_damaged(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.kmz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", bytes(70_000_000))
    refused(tmp_path / "a.kmz", "unpacks to 70 MB", "take out the road")
    content = (tmp_path / "a.kmz").read_bytes()
    (tmp_path / "b.kmz").write_bytes(content[: len(content) // 2])
    refused(tmp_path / "b.kmz", "damaged or cut-off", "fetch the file again")


def test_encrypted_files_are_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.kmz", "w") as archive:
        archive.writestr("doc.kml", b"<kml/>")
    content = bytearray((tmp_path / "a.kmz").read_bytes())
    content[content.find(b"PK\x01\x02") + 8] |= 1  # the flag in the directory; Python cannot write encrypted archives
    (tmp_path / "a.kmz").write_bytes(content)
    refused(tmp_path / "a.kmz", "is encrypted", "without a password")
    (tmp_path / "a.xlsx").write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600))
    refused(tmp_path / "a.xlsx", "old or an encrypted Office file", ".xlsx or .csv")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_texts_are_read_in_the_encodings_of_spreadsheets(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "a.csv").write_bytes(("Längengrad;Breitengrad;Straße\n" + ROWS).encode(encoding))
    assert text_of(tmp_path / "a.csv").startswith("Längengrad")
    road = load_road(tmp_path / "a.csv")
    assert road.path.length == pytest.approx(23.851, abs=1e-3)  # 4e-4 degrees of longitude at 57.7 degrees north on WGS84
    assert road.notes == ("a.csv: column Straße not read",)
