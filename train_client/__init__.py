"""The client on board: takes the ground's verdict and gates its own positioning. Its parts come with the train."""
