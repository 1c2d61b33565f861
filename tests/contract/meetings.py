"""Both sides of a link waiting for each other in one test."""

import threading
import time

from hil.errors import ConfigError, LinkError


def refusals(plant, controller, timeout_s=3.0):
    """What each side is told when both wait for each other at the same time."""
    told = {}

    def wait(side, connection):
        try:
            connection.link.wait_for_peer(timeout_s)
        except (ConfigError, LinkError) as error:
            told[side] = error
            connection.close()

    threads = [
        threading.Thread(target=wait, args=pair)
        for pair in (("plant", plant), ("controller", controller))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return told


def eventually(poll, seconds=3.0):
    end = time.monotonic() + seconds
    while not (found := poll()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return found
