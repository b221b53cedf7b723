"""OpenUSD with physics, for Isaac Sim, Omniverse and whatever reads UsdPhysics."""

from scenewright.stages.export.scene_registry import SceneFormat
from scenewright.stages.kit.stage import Extra

FORMAT = SceneFormat(
    "usd",
    order=10,
    file="scene.usdc",
    summary="OpenUSD with physics schemas, for Isaac Sim",
    extra=Extra("usd-core", "pxr", "`export scene --to usd`: pip install 'scenewright[usd]'"),
    notes=(
        "metres, kilograms, z up; links stand where they were reconstructed, joint positions count from the closed one",
        "friction of joints has no place in UsdPhysics and is left out; their damping is a drive without stiffness",
    ),
)
