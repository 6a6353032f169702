"""Every number printed in the thesis beside ours.

The numbers come from the model and the bundled scenes alone; nothing is tuned to agree. Where the
print cannot be reproduced, the row says so and why.
"""
