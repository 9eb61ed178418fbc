// The battery, in the Robot Language. `percentage` of sensor_msgs/BatteryState is 0 to 1.

type Battery

skillset power {
  data battery: Battery period 1 sec

  // Reported by the charger's driver.
  resource charger {
    state { OFF ON }
    initial OFF
    transition extern all
  }

  // Runs beside the work, and ends it when the battery is low: what is left then is for the way to the dock.
  // Once low it is so until the battery was charged; a single wrong value is forgiven.
  skill supply {
    precondition told: battery.percentage >= 0 % // its driver has told at all
    precondition enough: battery.percentage > 15 %
    invariant enough { guard battery.percentage > 15 % for 3 s recovers at 60 % }
    progress period 1 sec
    interrupt interrupting false
    failure FAILING {} // it falls so fast that 15 % would be too late
  }

  // Take current from the dock until the battery is full enough.
  skill charge {
    achieves (battery.percentage > 60 %)
    input level: float64 // 0 to 1
    precondition contact: charger == ON
    invariant contact: charger == ON
    progress period 1 sec
    interrupt interrupting false
    success CHARGED {}
    failure NOT_CHARGING {}
  }

  property only_in_the_dock: never (charge running and charger == OFF)
}
