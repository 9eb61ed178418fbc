"""The autopilot's sockets: a companion over TCP and a ground station over UDP, on one vehicle."""

import socket
import threading

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from uav_simulator_link import Link

from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.autopilot.link_server import LinkServer

WAIT_S = 2.0
LONG_S = 1e5  # longer than any test may take


@pytest.fixture
def links():
    """Return a vehicle's link, its server, a companion's socket and a ground station's."""
    link = Link(params={"FS_GCS_ENABLE": 1.0})
    link.endpoint.gcs_present = False
    ground = Endpoint(link.pilot, gcs_present=False)
    link.endpoint.connect(ground)
    server = LinkServer(link.endpoint, ground, port=0, gcs_port=0)
    companion = socket.create_connection(("127.0.0.1", server.port), WAIT_S)
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.settimeout(WAIT_S)
    station.connect(("127.0.0.1", server.gcs_port))
    server.serve(WAIT_S)
    yield link, ground, server, companion, station
    companion.close()
    station.close()
    server.close()


def heartbeat():
    sender = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    return mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3).pack(sender)


def advance(link, ground, server, seconds):
    for _ in range(round(seconds / 0.02)):
        link.vehicle.advance(0.02)
        link.ticks += 1
        link.pilot.step(link.now_s, 0.02)
        for endpoint in (link.endpoint, ground):
            endpoint.step()
        server.serve()


def test_a_ground_station_over_udp_keeps_the_failsafe_away_and_hears_the_vehicle(links):
    link, ground, server, companion, station = links
    link.pilot.arm()
    station.send(heartbeat())
    server.serve(WAIT_S)
    advance(link, ground, server, 1.2)
    heard = mavlink.MAVLink(None).parse_buffer(station.recv(65536))
    assert {m.get_srcSystem() for m in heard} == {1}
    assert "HEARTBEAT" in {m.get_type() for m in heard}
    forwarded = [m for m in mavlink.MAVLink(None).parse_buffer(companion.recv(65536)) if m.get_srcSystem() == 255]
    assert len(forwarded) == 1
    advance(link, ground, server, 3.0)
    assert link.pilot.armed
    advance(link, ground, server, 1.5)
    assert not link.pilot.armed, "on the ground its loss disarms"


def test_garbage_and_a_station_that_has_gone_do_no_harm(links):
    link, ground, server, companion, station = links
    station.send(b"\xfd" + bytes(range(256)))
    station.send(b"")
    station.send(heartbeat()[:-3])
    server.serve(WAIT_S)
    station.close()
    advance(link, ground, server, 2.0)
    assert mavlink.MAVLink(None).parse_buffer(companion.recv(65536))


def test_a_wait_is_ended_by_another_thread(links):
    _, _, server, _, _ = links
    for _ in range(3):
        waker = threading.Thread(target=server.wake)
        waker.start()
        server.serve(LONG_S)
        waker.join()
