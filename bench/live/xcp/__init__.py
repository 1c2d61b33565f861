"""An XCP slave on Ethernet: signals to be measured, parameters to be calibrated."""
