"""What recorded runs tell: conformance to the model, expectations, comparison, campaigns. No ROS; on top of records and missions."""
