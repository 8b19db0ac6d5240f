"""The cuttable path of `tests/benchmarks/stops_path.py`: what a cut lets through, and what becomes of what was under way."""

import socket
from collections.abc import Iterator
from contextlib import closing

import pytest

from tests.benchmarks.stops_path import CUT, Passage, Path

SOON_S, PATIENCE_S = 0.2, 5.0


@pytest.fixture
def upstream() -> Iterator[socket.socket]:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        server.settimeout(PATIENCE_S)
        yield server


@pytest.fixture
def path(upstream: socket.socket) -> Iterator[Path]:
    with Path(upstream.getsockname()) as path:
        yield path


@pytest.fixture
def ends(path: Path, upstream: socket.socket) -> Iterator[tuple[socket.socket, socket.socket]]:
    """Of the train, and of the station."""
    with socket.create_connection(path.address) as train, upstream.accept()[0] as station:
        train.sendall(b"before")
        assert station.recv(100) == b"before"
        for end in (train, station):
            end.settimeout(PATIENCE_S)
        yield train, station


def silent(end: socket.socket) -> bool:
    """Neither a byte nor the end comes, for a while."""
    end.settimeout(SOON_S)
    try:
        end.recv(100)
    except TimeoutError:
        return True
    finally:
        end.settimeout(PATIENCE_S)
    return False


@pytest.mark.parametrize("cut", CUT)
def test_nothing_comes_through_a_cut(path: Path, ends: tuple[socket.socket, socket.socket], cut: Passage) -> None:
    train, station = ends
    path.become(cut)
    train.sendall(b"up")
    station.sendall(b"down")
    assert silent(train) and silent(station)


@pytest.mark.parametrize("cut", CUT)
def test_the_end_of_a_connection_comes_only_after_a_cut(path: Path, ends: tuple[socket.socket, socket.socket], cut: Passage) -> None:
    train, station = ends
    path.become(cut)
    train.close()
    before = silent(station)
    path.become(Passage.OPEN)
    assert (before, station.recv(100)) == (True, b"")


def test_what_stands_goes_on(path: Path, ends: tuple[socket.socket, socket.socket]) -> None:
    train, station = ends
    path.become(Passage.STANDING)
    station.sendall(b"late")
    assert silent(train)
    path.become(Passage.OPEN)
    assert train.recv(100) == b"late"


def test_what_is_lost_does_not_come_back_and_ends_the_connection(path: Path, ends: tuple[socket.socket, socket.socket]) -> None:
    train, station = ends
    path.become(Passage.LOSING)
    station.sendall(b"lost")
    assert silent(train)
    path.become(Passage.OPEN)
    assert train.recv(100) == b""


@pytest.mark.parametrize("cut", CUT)
def test_who_dials_during_a_cut_gets_through_after_it(path: Path, upstream: socket.socket, cut: Passage) -> None:
    path.become(cut)
    with socket.create_connection(path.address) as train:
        train.sendall(b"hello")
        path.become(Passage.OPEN)
        with upstream.accept()[0] as station:
            station.settimeout(PATIENCE_S)
            assert station.recv(100) == b"hello"


def test_where_it_refuses_old_connections_go_on_and_new_ones_end(path: Path, ends: tuple[socket.socket, socket.socket]) -> None:
    train, station = ends
    path.become(Passage.REFUSING)
    station.sendall(b"still")
    with socket.create_connection(path.address, PATIENCE_S) as new:
        assert (train.recv(100), new.recv(100)) == (b"still", b"")
