"""A station behind the shipped router, with TLS, and trains and others who come with the certificates that they have."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from recordings.tls_files import TlsFiles
from tests.e2e.attacks.certified import SITE, certificates_in, of, secured, strangers_in, tls_table
from tests.e2e.attacks.relay import relaying
from tests.e2e.attacks.ride import Reached, Way
from tests.e2e.attacks.scene import Scene, scene
from tests.e2e.field import SITE_ID, Field
from tests.e2e.router import running_router
from tests.e2e.train_field import line_of


@contextmanager
def certified_scene(folder: Path) -> Iterator[Scene]:
    """The site under a name that the router knows; `scene.place.endpoint` is the router's."""
    certificates, _ = certificates_in(folder / "tls"), strangers_in(folder / "strangers")
    with running_router(certificates) as router:

        def behind_router(place: Field) -> Field:
            named = f'id = "{SITE_ID}"', f'id = "{SITE}"'
            place.site_file.write_text(place.site_file.read_text().replace(*named))
            place.trusted.write_text(place.trusted.read_text().replace(f'site = "{SITE_ID}"', f'site = "{SITE}"'))
            lines = f'listen = []\nconnect = ["{router}"]\nreaders = ["r291", "router"]'
            secured(of(certificates, SITE), place.site_file, place.endpoint, lines)
            return replace(place, endpoint=router)

        with scene(folder, prepare=behind_router, played_s=90.0) as here:
            here.site_id = SITE
            yield here


def with_certificate(name: str) -> Way:
    @contextmanager
    def way(scene: Scene, case: str) -> Iterator[Reached]:
        yield Reached(_train_file(scene, case, scene.place.endpoint, of(certificates_of(scene), name)))

    return way


@contextmanager
def with_strange_certificate(scene: Scene, case: str) -> Iterator[Reached]:
    """The train's name, by another authority, which it believes itself."""
    yield Reached(_train_file(scene, case, scene.place.endpoint, of(_strangers_of(scene), "r291")))


@contextmanager
def as_impostor(scene: Scene, case: str) -> Iterator[Reached]:
    """The train dials somebody who shows the station's name, by another authority."""
    with relaying(None, of(_strangers_of(scene), SITE)) as relay:
        yield Reached(_train_file(scene, case, relay.endpoint, of(certificates_of(scene), "r291")), relay)


def certificates_of(scene: Scene) -> Path:
    return scene.place.folder / "tls"


def _strangers_of(scene: Scene) -> Path:
    return scene.place.folder / "strangers"


def _train_file(scene: Scene, case: str, endpoint: str, files: TlsFiles) -> Path:
    file = scene.train_file(case, endpoint, "\n" + tls_table(files))
    file.write_text(file.read_text().replace(f'"{SITE_ID}"', f'"{SITE}"'))
    (file.parent / "line.json").write_text(line_of(SITE))
    return file
