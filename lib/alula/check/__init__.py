"""What is wrong with a mission's file before it is ticked: as a tree (``checking``), and against its robot's models (``mission``)."""
