"""Our method: types and rules by description length, planes that are computed."""
