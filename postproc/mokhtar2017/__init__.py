"""The paper of Mokhtar, Darpe and Gupta (2017): its claims and figures."""
