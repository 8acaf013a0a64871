"""python3 ros2.py playback.csv > transmission.xml

SimpleTransmission of ros2_control: joint position = actuator position / reduction + offset, rad. It
holds no curve: the ratio and the mean error, all that changes with the angle stays. A transmission
with a table is a plug-in of your own around the core.
Limits and signs: ros-controls/ros2_control 53b9999d simple_transmission.hpp.
"""

from curve import arguments

(curve,) = arguments()
print("<!--", *(f"  {line}" for line in curve.comments), "-->", sep="\n")
print(f"""<transmission name="flexspline">
  <plugin>transmission_interface/SimpleTransmission</plugin>
  <actuator name="generator" role="actuator1"/>
  <joint name="output" role="joint1">
    <mechanical_reduction>{curve.ratio:.12g}</mechanical_reduction>
    <offset>{curve.mean_rad:.9f}</offset>
  </joint>
</transmission>""")
