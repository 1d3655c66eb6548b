"""What is controlled: MuJoCo's truth about robot, object and contacts."""
