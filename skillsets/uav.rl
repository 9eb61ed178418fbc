// A vehicle whose pilot may take over at any time, in the Robot Language.
//
// `goto` is wrong on purpose, as such models easily are: it starts whenever the pilot does not hold the authority, but it may run
// only while the drone does, and the authority may be free. `./alula check` shows that: its invariant is false right after the
// start when `authority == None`. `goto_asking` and `goto_taking` are two ways to mend it.

type Position
type Meters

skillset uav {
  data position: Position period 500 ms

  resource authority {
    state { None Pilot Drone }
    initial None
    transition {
      None -> Pilot
      None -> Drone
      Pilot -> None
      Drone -> None
      Drone -> Pilot
    }
  }

  resource flight {
    state { OnGround Hovering Moving }
    initial OnGround
    transition all
  }

  event pilot_takes {
    guard authority != Pilot
    effect authority -> Pilot
  }

  event pilot_gives {
    guard authority == Pilot
    effect authority -> None
  }

  event drone_takes {
    guard authority == None
    effect authority -> Drone
  }

  skill takeoff {
    input height: Meters
    precondition {
      in_charge: authority == Drone
      on_ground: flight == OnGround
    }
    start flight -> Moving
    invariant moving: flight == Moving
    progress { period 1 sec  message height: Meters }
    interrupt { interrupting true  effect flight -> Hovering }
    success at_altitude {
      effect flight -> Hovering
      postcondition flight == Hovering
    }
    failure blocked { effect flight -> OnGround }
  }

  skill land {
    precondition hovering: flight == Hovering
    start flight -> Moving
    invariant moving: flight == Moving
    interrupt { interrupting true  effect flight -> Hovering }
    success on_ground { effect flight -> OnGround }
    failure blocked { effect flight -> Hovering }
  }

  skill goto {
    input target: Position
    precondition {
      not_the_pilot: authority != Pilot
      hovering: flight == Hovering
    }
    start flight -> Moving
    invariant {
      moving { guard flight == Moving }
      in_charge {
        guard authority == Drone
        effect flight -> Hovering
      }
    }
    interrupt { interrupting true  effect flight -> Hovering }
    success arrived { effect flight -> Hovering }
    failure blocked { effect flight -> Hovering }
  }

  skill goto_asking {
    input target: Position
    precondition {
      in_charge: authority == Drone
      hovering: flight == Hovering
    }
    start flight -> Moving
    invariant {
      moving { guard flight == Moving }
      in_charge {
        guard authority == Drone
        effect flight -> Hovering
      }
    }
    interrupt { interrupting true  effect flight -> Hovering }
    success arrived { effect flight -> Hovering }
    failure blocked { effect flight -> Hovering }
  }

  skill goto_taking {
    input target: Position
    precondition {
      free: authority == None
      hovering: flight == Hovering
    }
    start {
      authority -> Drone
      flight -> Moving
    }
    invariant {
      moving { guard flight == Moving }
      in_charge {
        guard authority == Drone
        effect flight -> Hovering
      }
    }
    interrupt { interrupting true  effect flight -> Hovering }
    success arrived { effect flight -> Hovering }
    failure blocked { effect flight -> Hovering }
  }

  property moves_in_charge: never (goto_asking running and authority != Drone)
  property gets_somewhere: goto_taking running leads to flight != Moving assuming termination
}
