"""The world and the road users in it, without any radar.

Public names are imported on first use.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.scenes.core.materials import Material as Material
    from echoscape.scenes.core.scene import Scene as Scene
    from echoscape.scenes.core.target_meshes import with_targets as with_targets
    from echoscape.scenes.core.targets import Target as Target
    from echoscape.scenes.driving.ego_drive import plan_ego_drive as plan_ego_drive
    from echoscape.scenes.io.osm.build import build_osm_scene as build_osm_scene
    from echoscape.scenes.io.osm.extract import read_osm as read_osm
    from echoscape.scenes.io.user_scene import read_user_scene as read_user_scene
    from echoscape.scenes.town.build import build_town as build_town
    from echoscape.scenes.traffic.plan import plan_traffic as plan_traffic
else:
    from lazy_loader import attach

    __getattr__, __dir__, __all__ = attach(
        __name__,
        submod_attrs={
            "core.materials": ["Material"],
            "core.scene": ["Scene"],
            "core.target_meshes": ["with_targets"],
            "core.targets": ["Target"],
            "driving.ego_drive": ["plan_ego_drive"],
            "io.osm.build": ["build_osm_scene"],
            "io.osm.extract": ["read_osm"],
            "io.user_scene": ["read_user_scene"],
            "town.build": ["build_town"],
            "traffic.plan": ["plan_traffic"],
        },
    )
