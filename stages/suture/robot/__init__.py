"""The da Vinci research kit's patient-side manipulators: kinematics and where the two arms stand."""
