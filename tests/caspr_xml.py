"""Small CASPR files of the tests' own, and a folder to put them in."""

from pathlib import Path

REAL = Path(__file__).parent.parent.parent / "shared" / "data" / "caspr"

BODIES = """\
<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE bodies_system SYSTEM "../bodies.dtd">
<bodies_system>
  <links display_range="0 1 0 1 0 1">
    <link_rigid num="1" name="box">
      <joint type="SPATIAL_EULER_XYZ" q_initial="0.1 0.2 0.3 0.4 0.5 0.6"/>
      <physical>
        <mass>2.5</mass>
        <com_location>0.1 0.0 -0.2</com_location>
        <end_location>0 0 0</end_location>
        <inertia ref="com">
          <Ixx>0.3</Ixx><Iyy>0.4</Iyy><Izz>0.5</Izz><Ixy>0.01</Ixy><Ixz>-0.02</Ixz><Iyz>0.03</Iyz>
        </inertia>
      </physical>
      <parent><num>0</num><location>0 0 0</location></parent>
    </link_rigid>
  </links>
</bodies_system>
"""

CABLES = """\
<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE cables SYSTEM "../cables.dtd">
<cables default_cable_set="two">
  <cable_set id="one">
    <cable_ideal name="only" attachment_reference="com">
      <properties><force_min>0</force_min><force_max>50</force_max></properties>
      <attachments>
        <attachment><link>0</link><location>0 0 5</location></attachment>
        <attachment><link>1</link><location>0 0 0.25</location></attachment>
      </attachments>
    </cable_ideal>
  </cable_set>
  <cable_set id="two">
    <cable_ideal name="left" attachment_reference="joint">
      <properties><force_min>1.0</force_min><force_max>80</force_max></properties>
      <attachments>
        <attachment><link>0</link><location>-1 0 2</location></attachment>
        <attachment><link>1</link><location>-0.5 0 0.25</location></attachment>
      </attachments>
    </cable_ideal>
    <cable_linear_spring name="right" attachment_reference="com">
      <properties><K>1.3e4</K><force_min>1</force_min><force_max>80</force_max></properties>
      <attachments>
        <base_rotating_pulley>
          <fixed_location>1 0 2</fixed_location>
          <pulley_radius>0.045</pulley_radius>
          <cable_entry_vector>0 0 1</cable_entry_vector>
        </base_rotating_pulley>
        <attachment><link>1</link><location>0.5 0 0.25</location></attachment>
      </attachments>
    </cable_linear_spring>
  </cable_set>
</cables>
"""


def write(folder: Path, bodies: str | bytes = BODIES, cables: str | bytes = CABLES) -> Path:
    """Write both files to `folder`, which it returns."""
    for name, content in (("bodies", bodies), ("cables", cables)):
        data = content.encode() if isinstance(content, str) else content
        (folder / f"my_{name}.xml").write_bytes(data)
    return folder
