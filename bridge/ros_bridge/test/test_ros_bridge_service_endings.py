"""Services when the master or the bridge goes."""

import signal

from ros_bridge_harness import BridgeProcess
from ros_bridge_service_peers import (
    SERVICES,
    Client,
    HeldService,
    Server,
    answer,
    echoed,
    greet,
    request_from,
    sensor_request,
    serve_echo,
    text,
)
from std_srvs.srv import SetBool

from alula_testing.waits import HANGS_S, until

CONFIG = SERVICES


def test_restarted_master_learns_where_services_are(world):
    serve_echo(world)
    with Client(world, "/bv/in_ros2", persistent="1") as old:
        before = world.proxy.lookupService("/t", "/bv/in_ros2")[2]
        world.master.close()
        assert old.call(sensor_request("no master")) == echoed("no master")
        world.master.start()
        until(lambda: world.proxy.lookupService("/t", "/bv/in_ros2")[0] == 1, "the service is registered again")
        assert world.proxy.lookupService("/t", "/bv/in_ros2")[2] == before
    with Client(world, "/bv/in_ros2") as new:
        assert new.call(sensor_request("again")) == echoed("again")


def test_end_of_the_bridge_answers_every_call_under_way_and_unregisters(world, tmp_path):
    names = {"/bv_end/in_ros1": "ros1", "/bv_end/in_ros2": "ros2"}
    lines = [f"  - {{name: {name}, server: {where}, type: std_srvs/SetBool, timeout_s: 30.0}}" for name, where in names.items()]
    bridge = BridgeProcess(world.master, tmp_path, "services:\n" + "\n".join(lines) + "\n", "__name:=ros_bridge_that_ends")
    bridge.wait_running()
    held = HeldService(world, "/bv_end/in_ros2")
    arrived = []

    def talk(connection):
        greet(connection)
        while True:
            arrived.append(request_from(connection))
            if len(arrived) == 1:
                answer(connection, b"\1" + text(""))

    in_ros1 = world.ros2.node.create_client(SetBool, "/bv_end/in_ros1")
    with Client(world, "/bv_end/in_ros2") as client, Server(world, "/bv_end/in_ros1", talk):
        assert in_ros1.wait_for_service(HANGS_S)
        assert in_ros1.call(SetBool.Request(), timeout_sec=HANGS_S).success
        future = in_ros1.call_async(SetBool.Request())
        client.send(b"\1")
        until(lambda: len(arrived) == 2 and held.taken, "both calls arrive")
        bridge.process.send_signal(signal.SIGINT)
        good, reason = client.receive()
        assert (good, b"the bridge is shutting down" in reason) == (False, True)
        until(future.done, "the call from ROS 2 ends")
        assert "the bridge is shutting down" in future.result().message
        assert bridge.process.wait(HANGS_S) == 0
    assert world.proxy.lookupService("/t", "/bv_end/in_ros2")[0] == -1
    world.ros2.node.destroy_client(in_ros1)
    held.service.close()
